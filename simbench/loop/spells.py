"""Spells that come and go: how much of the time they fill, and how long one lasts."""

from __future__ import annotations

from typing import Any

import numpy as np

from simbench.loop.parameters import Number

SPELLS = {
    "share": Number("-", low=0.0, high=0.95, default=0.0, identity=0.0, says="of the time"),
    "length": Number(
        "s", low=0.0, positive=True, default=10.0, identity=10.0, says="mean length of a spell"
    ),
}


def spells(setup: Any, p: Any, rng: np.random.Generator) -> np.ndarray:
    """Return 1.0 in spells of a mean length `p.length` (s) that fill a share of the run, 0.0
    between them.
    """
    # On or off to begin with, by the share
    out = np.zeros(setup.sp.size)
    length = p.length / setup.Ts
    k = 0
    on = rng.random() < p.share

    # Each spell has an exponential length; those between make up the share
    while k < out.size:
        if on:
            mean = length
        else:
            mean = length * (1.0 - p.share) / p.share
        k_next = k + max(round(rng.exponential(max(mean, 1.0))), 1)
        out[k:k_next] = float(on)
        k = k_next
        on = not on

    # The first sample is never in a spell
    out[0] = 0.0
    return out

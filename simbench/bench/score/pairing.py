"""Which loop of one run is which of another: the one that has its id."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simbench.bench.store.reading import RunArrays


class Pairs(NamedTuple):
    """The loops two runs have in common."""

    # now, before: (m,) where each stands in either run
    now: np.ndarray
    before: np.ndarray
    same: np.ndarray  # (m,) whether the two records are the same, bit for bit


def pair(now: RunArrays, before: RunArrays) -> Pairs:
    """Pair the loops of two runs."""
    _, at, was_at = np.intersect1d(now.ids, before.ids, return_indices=True)
    return Pairs(at, was_at, now.hashes[at] == before.hashes[was_at])

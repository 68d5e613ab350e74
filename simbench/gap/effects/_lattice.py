"""Shared by the quantisation effects: how many levels of PV or OP are used."""

from __future__ import annotations

import numpy as np

from simbench.detectors.signal.lattice import lattice, root_lattice, written_unit


def levels_of(x: np.ndarray, other: np.ndarray) -> str:
    """Return how many levels a signal has, and how far apart; "" where it has none.
    `other`: of the same file.
    """
    step = lattice(x, written_unit(x, other)) or root_lattice(x)
    if step == 0.0:
        return ""
    share = f"{step / float(x.std()):.1%} of the standard deviation"
    return f"{x.size} samples on {np.unique(x).size} levels, {step:.3g} apart ({share})"

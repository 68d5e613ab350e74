"""Which loop of one run is which of another: by its place in the grid, or by its id where the grids
differ.
"""

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
    # whether the runs are of the very same grid, so that a loop that is missing is a fault
    one_grid: bool


def pair(now: RunArrays, before: RunArrays) -> Pairs:
    """Pair the loops of two runs."""
    one_grid = now.manifest.get("grid_hash") == before.manifest.get("grid_hash")
    keys = (now.places, before.places) if one_grid else (now.ids, before.ids)
    _, at, was_at = np.intersect1d(*keys, return_indices=True)
    same = now.hashes[at] == before.hashes[was_at]
    if not one_grid and not same.all():  # other seeds or settings: what they share is chance
        at, was_at, same = at[:0], was_at[:0], same[:0]
    return Pairs(at, was_at, same, one_grid)

"""Choose among the loops that may copy a record the one whose simulations are nearest to the part
that was fitted.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from simbench.gap.closed_loop.copies import Copy, archived
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.closed_loop.summary_features import distance, features, least_spread, seed_spread
from simbench.gap.situation import Situation

_SEEDS = 16  # simulations of each
_FROM = 0.3  # of the record: what lies before is the way from rest


class Near(NamedTuple):
    """The loop that copies a record, what it is made of, whether its archive repeats samples, and
    how far its simulations are from the fitted part.
    """

    copy: Copy
    held: bool
    distance: float


def nearest(s: Situation, tried: Iterable[Copy], seed: int = 0) -> Near | None:
    """Return the copy of a record whose simulations are nearest to it between 30 and 65 %, of
    copies as near the plainest; None where none can be simulated.
    """
    fitted = FittedPart(s)
    found: list[Near] = []
    repeats = any(np.any(np.diff(x) == 0.0) for x in (s.op, s.record.pv))
    for copy in tried:
        for held in (False, True) if repeats else (False,):
            loop = archived(copy.loop, s, held)
            records = run_with_seeds(loop.with_("sampling.n", held_out(s)), seed, _SEEDS)
            if records is None:
                continue
            runs = np.array([(r.op, r.pv) for r in records])
            found.append(Near(copy._replace(loop=loop), held, fitted.distance(runs)))
    return min(found, key=lambda near: near.distance, default=None)


class FittedPart:
    """The part of a record, from 30 to 65 %, by which loops are chosen that were fitted to it."""

    def __init__(self, s: Situation) -> None:
        self.part = slice(int(_FROM * s.record.n), held_out(s))
        self.sp = s.sp[self.part]
        named = features(s.op[self.part], s.record.pv[self.part], self.sp)
        self.real = np.array(list(named.values()))
        self.least = least_spread(named, self.sp.size)

    def distance(self, runs: np.ndarray) -> float:
        """Return how far OP and PV of simulations, shape (seeds, 2, n), are from the record."""
        op = runs[:, 0, self.part]
        pv = runs[:, 1, self.part]
        simulated = np.array(list(features(op, pv, self.sp).values())).T
        return distance(self.real, simulated, seed_spread(simulated, self.least))

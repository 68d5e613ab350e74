"""Compare the same loops: which loop of one run is which of another, the one that has its id, and
what two sets of answers to the same loops win and lose against each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simbench.bench.statistics import mcnemar
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


class Paired(NamedTuple):
    """Of n loops: where only the first of two answers was right (win), only the second (loss), both
    or neither (tie).
    """

    n: int
    win: int
    tie: int
    loss: int

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray) -> Paired:
        """Count two sets of answers, each (n,) right or not."""
        win = int((first & ~second).sum())
        loss = int((~first & second).sum())
        return cls(first.size, win, first.size - win - loss, loss)

    @property
    def p(self) -> float:
        """Exact McNemar p-value of "both are right equally often"."""
        return mcnemar(self.loss, self.win)

    @property
    def p_worse(self) -> float:
        """That of "the second is not right less often", one-sided."""
        return mcnemar(self.win, self.loss, worse=True)

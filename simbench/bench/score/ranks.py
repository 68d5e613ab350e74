"""Which methods can a run tell apart? The smallest difference it resolves, shared ranks, and how
many loops more would take.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats

UNDECIDED = 0.5  # cost of no decision; an error costs 1
_LEVEL = 0.95
_POWER = 0.90
# with a clear label: fewer rank nobody, as the 95 % interval of a rate is then wider than .3
RANKED_LOOPS = 30


class Ranks(NamedTuple):
    """Who stands where."""

    # (m,) 1 = no method is better by a difference that these loops resolve between the two; 2 =
    # only methods of rank 1 are, and so on
    rank: np.ndarray
    # a difference of the mean that is resolved between any two of them; NaN without methods or
    # loops
    resolution: float
    # largest variance of a difference times the number of loops; what `loops_needed` takes
    spread: float


def rank_methods(
    right: np.ndarray,
    groups: np.ndarray | None = None,
    accuracy: np.ndarray | None = None,
    loops: int | None = None,
) -> Ranks:
    """Rank methods by what each earns on the same loops.

    Two methods are held against each other by themselves, and a rank is one more than the last of
    those that are better: no rank depends on who else is compared, and none moves when a copy of a
    method joins. The variance of a difference is the group bootstrap's (whole groups drawn with
    replacement), in its closed form for many draws: the sum over groups of their squared share in
    it. It is not taken smaller than for methods whose errors have nothing to do with each other, p
    (1 - p) + q (1 - q): a near copy of a method is no rival, however surely a paired test tells it
    from its original (`simbench score --paired`). A difference counts from 1.96 sd. Where `right`
    is of a sample, `accuracy` is the mean of each method on all `loops`.
    """
    # Success of every method, and of groups of loops
    m, n = right.shape
    if m == 0 or n == 0:
        return Ranks(np.ones(m, dtype=int), float("nan"), float("nan"))
    earned = right.astype(float)
    if groups is None:
        place = np.arange(n)
    else:
        place = np.unique(groups, return_inverse=True)[1]
    centred = earned - earned.mean(axis=1, keepdims=True)
    shares = np.array([np.bincount(place, row) for row in centred])

    # one success and one failure added: few loops never show a rate exactly
    alone = np.array([np.var(np.r_[row, 0.0, 1.0]) for row in earned])
    together = ((shares[:, None] - shares[None]) ** 2).sum(axis=2) / n
    spreads = np.maximum(together, alone[:, None] + alone[None])

    # A method ranks below those that are better by a resolved difference
    if accuracy is None:
        means = earned.mean(axis=1)
    else:
        means = accuracy
    better = np.subtract.outer(means, means).T >= _least_difference(spreads, loops or n)
    rank = np.ones(m, dtype=int)
    for k in np.argsort(-means, kind="stable"):
        rank[k] = 1 + max(rank[better[k]], default=0)
    spread = float(max(together.max(), 2.0 * alone.max()))
    return Ranks(rank, float(_least_difference(np.array(spread), loops or n)), spread)


def _least_difference(spread: np.ndarray, loops: int) -> np.ndarray:
    """Return the least difference of means that so many loops resolve."""
    return stats.norm.ppf(0.5 + _LEVEL / 2) * np.sqrt(spread / loops)


def loops_needed(difference: float, spread: float) -> int:
    """Return how many loops tell a difference of accuracy apart in nine of ten runs."""
    z = float(stats.norm.ppf(0.5 + _LEVEL / 2) + stats.norm.ppf(_POWER))
    return int(np.ceil(z * z * spread / difference**2))

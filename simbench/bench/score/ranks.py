"""Which methods can a run tell apart? The smallest difference it resolves, shared ranks, and how many loops more would take."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import stats

LEVEL, POWER = 0.95, 0.90


class Ranks(NamedTuple):
    """Who stands where.

    Parameters
    ----------
    rank : ndarray, shape (m,)
        1 = no method is better by a difference the run resolves; methods that cannot be told apart share a rank.
    resolution : float
        Smallest difference of accuracy that counts; NaN without methods or loops.
    spread : float
        Largest variance of a difference times the number of loops; what `loops_needed` takes.
    """

    rank: np.ndarray
    resolution: float
    spread: float


def rank_methods(right: np.ndarray) -> Ranks:
    """Rank methods by how often each is right on the same loops.

    Parameters
    ----------
    right : ndarray of bool, shape (m, n)
        Whether m methods are right on n loops; no decision is not right.

    Returns
    -------
    Ranks

    Notes
    -----
    The difference of two accuracies on n loops has the variance d/n, d the share of loops on which one of the two alone is
    right (McNemar's test, normal form). d is not taken smaller than for methods whose errors have nothing to do with each
    other, p (1 - p) + q (1 - q): a near copy of a method is no rival, however surely a paired test tells it from its original
    (`simbench score --paired`). The largest pair's 1.96 sqrt(d/n) is the resolution, for all pairs alike. A method's rank is
    one more than the number of methods that are better by that much. Not for choosing between two versions of one method:
    that is a paired test's work.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> right = np.array([rng.random(4000) < 0.8, rng.random(4000) < 0.8, rng.random(4000) < 0.7])
    >>> rank_methods(right).rank.tolist()
    [1, 1, 3]
    """
    m, n = right.shape
    if m == 0 or n == 0:
        return Ranks(np.ones(m, dtype=int), float("nan"), float("nan"))
    # a method alone is held against one as good
    pairs = combinations(range(m), 2) if m > 1 else [(0, 0)]
    spread = max(_spread(right[i], right[j]) for i, j in pairs)
    resolution = float(stats.norm.ppf(0.5 + LEVEL / 2) * np.sqrt(spread / n))
    accuracy = right.mean(axis=1)
    better = accuracy[None, :] - accuracy[:, None] >= resolution
    return Ranks(1 + better.sum(axis=1), resolution, spread)


def loops_needed(difference: float, spread: float) -> int:
    """Return how many loops tell a difference of accuracy apart in nine of ten runs.

    Parameters
    ----------
    difference : float
        Above 0, e.g. 0.03.
    spread : float
        Of `rank_methods`.

    Returns
    -------
    int

    Examples
    --------
    >>> loops_needed(0.03, 0.42)
    4904
    """
    z = float(stats.norm.ppf(0.5 + LEVEL / 2) + stats.norm.ppf(POWER))
    return int(np.ceil(z * z * spread / difference**2))


def _spread(one: np.ndarray, two: np.ndarray) -> float:
    # one success and one failure added: a method that is always right on few loops is not known exactly
    p, q = ((x.sum() + 1.0) / (x.size + 2.0) for x in (one, two))
    return max(float((one != two).mean()), float(p * (1 - p) + q * (1 - q)))

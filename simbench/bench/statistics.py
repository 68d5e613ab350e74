"""The statistics of a benchmark: intervals of rates and AUC, paired and unpaired tests, corrections
for many tests.

McNemar and Friedman are scipy's. Wilson and Holm are a few lines: a library that has them
(statsmodels) would serve nothing else here. AUC is counted here because scikit-learn gives neither
DeLong's interval nor ranks of infinite scores.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy.special import ndtri

_LEVEL = 0.95


class Estimate(NamedTuple):
    """A number with its interval."""

    value: float
    lo: float
    hi: float

    def __str__(self) -> str:
        """Return e.g. "0.812 (0.790 to 0.832)"."""
        return f"{self.value:.3f} ({self.lo:.3f} to {self.hi:.3f})"


def wilson(right: ArrayLike, of: ArrayLike, level: float = _LEVEL) -> tuple[np.ndarray, np.ndarray]:
    """Return Wilson's score interval of a proportion.

    Wilson (1927), J. Am. Stat. Assoc. 22, 209; vectorised form of
    `scipy.stats.binomtest(...).proportion_ci("wilson")`.
    """
    k, n = np.broadcast_arrays(np.asarray(right, dtype=float), np.asarray(of, dtype=float))
    z = ndtri(0.5 + level / 2)
    some = np.maximum(n, 1.0)
    p = k / some
    centre = p + z * z / (2 * some)
    scale = 1 + z * z / some
    half = z * np.sqrt(p * (1 - p) / some + z * z / (4 * some * some))
    # at 0 and n the bound is exact; rounding must not push it past the estimate
    lo = np.where((n > 0) & (k > 0), (centre - half) / scale, 0.0)
    hi = np.where((n > 0) & (k < n), (centre + half) / scale, 1.0)
    return lo, hi


def rate(right: int, of: int) -> Estimate:
    """Return a proportion with Wilson's interval; NaN (0, 1) without trials."""
    lo, hi = wilson(right, of)
    return Estimate(right / of if of else float("nan"), float(lo), float(hi))


def mcnemar(lost: int, won: int, *, worse: bool = False) -> float:
    """Return the exact McNemar p-value of paired right/wrong answers.

    McNemar (1947), Psychometrika 12, 153; the exact form is a binomial test of lost against lost +
    won at 1/2.
    """
    if lost + won == 0:
        return 1.0
    side = "greater" if worse else "two-sided"
    return float(scipy.stats.binomtest(int(lost), int(lost + won), 0.5, alternative=side).pvalue)


def holm(p: ArrayLike) -> np.ndarray:
    """Return p-values corrected for their number.

    Holm (1979), Scand. J. Stat. 6, 65. It needs no independence; with thousands of tests it has
    little power.
    """
    p = np.asarray(p, dtype=float)
    order = np.argsort(p, kind="stable")
    steps = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    out = np.empty_like(p)
    out[order] = np.minimum(steps, 1.0)
    return out


def auc(score: ArrayLike, positive: ArrayLike, level: float = _LEVEL) -> Estimate:
    """Return the area under the ROC curve with DeLong's interval.

    DeLong, DeLong and Clarke-Pearson (1988), Biometrics 44, 837, by midranks (Sun and Xu 2014). The
    interval is that of the logit, so that it stays within 0..1; at AUC 0 or 1 DeLong's variance is
    0, and Wilson's interval of the smaller class stands in.
    """
    positive = np.asarray(positive, dtype=bool)
    m = int(positive.sum())
    n = int((~positive).sum())
    if min(m, n) == 0:
        return Estimate(float("nan"), 0.0, 1.0)
    value, variance = _auc_variance(score, positive)
    if variance == 0.0 or value in (0.0, 1.0):
        return Estimate(value, *(float(x) for x in wilson(value * min(m, n), min(m, n), level)))
    centre = np.log(value / (1 - value))
    slope = 1 / (value * (1 - value))
    half = ndtri(0.5 + level / 2) * np.sqrt(variance) * slope
    return Estimate(value, *(float(1 / (1 + np.exp(-(centre + s * half)))) for s in (-1, 1)))


def area(ranks: np.ndarray, positive: np.ndarray) -> float:
    """Return the area under the ROC curve of dense ranks; NaN with one class only.

    >>> area(np.array([0, 1, 2, 3]), np.array([False, True, False, True]))
    0.75
    """
    m = int(positive.sum())
    n = positive.size - m
    if min(m, n) == 0:
        return float("nan")
    ups, downs = class_counts(ranks, positive)
    return float(ups @ (2 * np.cumsum(downs) - downs) / (2 * m * n))


def dense_ranks(score: np.ndarray) -> np.ndarray:
    """Return where each score stands among the different ones, from 0; -1 for NaN.

    >>> dense_ranks(np.array([0.5, -np.inf, np.nan, 0.5])).tolist()
    [1, 0, -1, 1]
    """
    known = ~np.isnan(score)
    ranks = np.full(score.shape, -1, dtype=np.int32)
    ranks[known] = np.unique(score[known], return_inverse=True)[1]
    return ranks


def class_counts(ranks: np.ndarray, positive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how many positives and negatives stand at every rank that occurs, from the lowest.

    >>> [c.tolist() for c in class_counts(np.array([7, 2, 7]), np.array([True, False, False]))]
    [[0, 1], [1, 1]]
    """
    # one sort of whole numbers, several times as fast as ranking floats
    keys = np.sort(2 * ranks.astype(np.int64) + positive)
    place = keys >> 1
    starts = np.concatenate([[0], np.flatnonzero(place[1:] != place[:-1]) + 1])
    ups = np.add.reduceat(keys & 1, starts)
    return ups, np.diff(starts, append=keys.size) - ups


def auc_drop(before: ArrayLike, now: ArrayLike, positive: ArrayLike) -> float:
    """Return the p-value of "the AUC did not fall", from two scores of the same cases.

    DeLong's paired test (see `auc`), one-sided.
    """
    # Placements of each score among the other class (DeLong 1988)
    positive = np.asarray(positive, dtype=bool)
    m = int(positive.sum())
    n = int((~positive).sum())
    if min(m, n) < 2:
        return 1.0
    change = []
    for a, b in zip(*(_placement_values(_nan_lowest(s), positive) for s in (before, now))):
        change.append(a - b)

    # The mean change over its standard error
    drop = change[0].mean()
    variance = np.var(change[0], ddof=1) / m + np.var(change[1], ddof=1) / n
    if variance == 0.0:
        return 0.0 if drop > 0 else 1.0
    return float(scipy.stats.norm.sf(drop / np.sqrt(variance)))


def _nan_lowest(score: ArrayLike) -> np.ndarray:
    s = np.asarray(score, dtype=float)
    return np.where(np.isnan(s), -np.inf, s)


def _auc_variance(score: ArrayLike, positive: np.ndarray) -> tuple[float, float]:
    places = np.asarray(score)
    if places.dtype.kind != "i":
        places = dense_ranks(_nan_lowest(score))
    ups, downs = class_counts(places, positive)
    m = int(ups.sum())
    n = int(downs.sum())

    # twice the negatives below a positive, and the positives above a negative, ties half
    below = 2 * np.cumsum(downs) - downs
    above = 2 * m - (2 * np.cumsum(ups) - ups)
    variance = 0.0
    for times, share, size in ((ups, below / (2 * n), m), (downs, above / (2 * m), n)):
        if size > 1:
            variance += float(times @ (share - times @ share / size) ** 2) / (size - 1) / size
    return float(ups @ below / (2 * m * n)), variance


def _placement_values(score: np.ndarray, positive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # share of the other class that each case is on the right side of, by midranks
    m = positive.sum()
    n = (~positive).sum()
    joint = scipy.stats.rankdata(score)
    of_positive = (joint[positive] - scipy.stats.rankdata(score[positive])) / n
    of_negative = 1 - (joint[~positive] - scipy.stats.rankdata(score[~positive])) / m
    return of_positive, of_negative

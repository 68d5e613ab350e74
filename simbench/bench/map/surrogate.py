"""Surrogate model of one method on one grid: the probability of each outcome in a cell, with its
uncertainty.

Estimates for the whole grid are model-assisted: the mean prediction over the scenarios that were
not simulated, corrected by the mean error of predictions for simulated scenarios out of sample
(Särndal, Swensson and Wretman 1992, Model Assisted Survey Sampling, ch. 6; with random forests:
Dagdoug, Goga and Haziza 2023, J. Am. Stat. Assoc. 118, 1234). They hold for any surrogate, a poor
one only widens the interval.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from simbench.bench.score.ranks import UNDECIDED
from simbench.bench.statistics import Estimate, wilson
from simbench.bench.store.reading import CODES
from simbench.detectors.verdict import STICTION

# an outcome is 6 * oscillating + 3 * truth + verdict; the last one has no clear label, or the
# method does not apply to it
OUTCOMES = 13
NOT_COUNTED = OUTCOMES - 1
_TRUTH, _VERDICT = np.divmod(np.arange(NOT_COUNTED) % 6, 3)
_COUNTED = np.r_[np.ones(NOT_COUNTED), 0.0]
IF_OSCILLATING = np.r_[np.zeros(6), np.ones(6), 0.0]
_RIGHT = np.r_[_TRUTH == _VERDICT, 0.0].astype(float)
_POSITIVE = np.r_[_TRUTH, 0.0]
_YES = np.r_[_VERDICT == CODES[STICTION], 0.0].astype(float)
OUTCOME_COST = np.r_[np.where(_VERDICT == CODES["no_decision"], UNDECIDED, _TRUTH != _VERDICT), 0.0]
# each rate as shares of outcomes: numerator over denominator
RATES = {
    "cost": (OUTCOME_COST, _COUNTED),
    "accuracy": (_RIGHT, _COUNTED),
    "sensitivity": (_YES * _POSITIVE, _POSITIVE),
    "false_positives": (_YES * (_COUNTED - _POSITIVE), _COUNTED - _POSITIVE),
}
_BAGS = 24  # halves of the sample; the spread between them is the sampling error
_TREES = 4  # of each half
_LEAF = 3  # scenarios
# of a cell's scenarios that must be expected to count for a rate; else it has none
_LEAST_SHARE = 0.05
_MOST_TRIALS = 100  # scenarios that an estimate of one cell rests on, at most
_Z = 1.96  # of 95 %


@dataclass(frozen=True)
class Surrogate:
    """Random forests on halves of a sample, whole cells in or out."""

    forests: tuple  # one a half
    outside: np.ndarray  # (halves, n) which scenarios a half does not have
    features: np.ndarray  # (n, k) of the sample
    outcome: np.ndarray  # (n,) of the sample
    cells: np.ndarray  # (n,) of the sample

    @classmethod
    def fit(cls, features: np.ndarray, outcome: np.ndarray, cells: np.ndarray) -> Surrogate:
        """Learn the outcomes (n,) of scenarios from features (n, k); `cells` (n,) are those they
        stand in.
        """
        from sklearn.ensemble import RandomForestClassifier  # here, for it takes a second to load

        rng = np.random.default_rng(0)
        unique, place = np.unique(cells, return_inverse=True)
        forests, outside = [], []
        for number in range(_BAGS):
            inside = np.isin(place, rng.permutation(unique.size)[: max(unique.size // 2, 1)])
            forest = RandomForestClassifier(
                _TREES, min_samples_leaf=_LEAF, max_features=None, random_state=number
            )
            forests.append(forest.fit(features[inside], outcome[inside]))
            outside.append(~inside)
        return cls(tuple(forests), np.array(outside), features, outcome, cells)

    def halves(self, features: np.ndarray) -> np.ndarray:
        """Return the probability of each outcome as each half tells it (halves x n x outcomes)."""
        out = np.zeros((len(self.forests), len(features), OUTCOMES), dtype=np.float32)
        for probability, forest in zip(out, self.forests, strict=True):
            probability[:, forest.classes_] = forest.predict_proba(features)
        return out

    @cached_property
    def _on_sample(self) -> np.ndarray:
        return self.halves(self.features)

    @property
    def in_sample(self) -> np.ndarray:
        """The probability of each outcome (n x outcomes) of the sample's scenarios, from all
        halves.
        """
        return self._on_sample.mean(axis=0)

    @property
    def out_of_sample(self) -> np.ndarray:
        """The same from the halves that do not have the scenario."""
        return np.einsum(
            "bn,bnk->nk", self.outside / np.maximum(self.outside.sum(axis=0), 1), self._on_sample
        )

    def brier(self) -> float:
        """Return the mean squared error of the predicted accuracy of single scenarios out of
        sample.
        """
        counted = self.outcome != NOT_COUNTED
        predicted = rate(self.out_of_sample[counted], "accuracy")
        return (
            float(np.nanmean((predicted - _RIGHT[self.outcome[counted]]) ** 2))
            if counted.any()
            else np.nan
        )


def rate(probability: np.ndarray, name: str) -> np.ndarray:
    """Return a rate from probabilities (..., outcomes); NaN where hardly any scenario is expected
    to count for it.
    """
    top, bottom = (probability @ weights for weights in RATES[name])
    enough = bottom > _LEAST_SHARE * probability.sum(axis=-1)
    return np.divide(top, bottom, out=np.full(np.shape(bottom), np.nan), where=enough)


def rate_of_cells(halves: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a rate of cells and its 95 % interval, from probabilities (halves, cells, outcomes).

    The interval covers the sampling error of the surrogate: what it would answer after another
    sample of the same size. Each half is trained on half of the cells, and the variance of
    estimates on halves drawn without replacement is that of the estimate on the whole sample (the
    grouped jackknife that deletes half of the groups; Sexton and Laake 2009, Comput. Stat. Data
    Anal. 53, 801, for forests). It does not cover what a forest smooths away between neighbouring
    cells.
    """
    value = rate(halves.mean(axis=0), name)
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # cells of which no half knows the rate
        variance = np.nanvar(rate(halves, name), axis=0, ddof=1)
    # Wilson's interval with as many trials as the variance speaks of, at most _MOST_TRIALS, stays
    # within 0 and 1
    near = (value * _MOST_TRIALS + 1.0) / (_MOST_TRIALS + 2.0)
    trials = 1.0 / (variance / (near * (1.0 - near)) + 1.0 / _MOST_TRIALS)
    lo, hi = wilson(value * trials, trials)
    return value, lo, hi


def rate_of_grid(
    surrogate: Surrogate, mean: np.ndarray, size: int, only: np.ndarray | None = None
) -> Estimate:
    """Return the cost of a method on all `size` scenarios of a grid, with its 95 % interval.

    `mean` holds the mean probability of each outcome over the grid; `only` which outcomes count
    (default: all with a clear label). The interval covers the error of not having simulated the
    rest of this grid with this seed; a sample of all scenarios has none. Errors in one cell hang
    together.
    """
    counts = _COUNTED if only is None else only
    seen, n = np.eye(OUTCOMES)[surrogate.outcome], surrogate.outcome.size
    if not (seen @ counts).any():
        return Estimate(np.nan, 0.0, 1.0)
    share, error = n / size, seen - surrogate.out_of_sample
    # of the scenarios that were not simulated
    rest = (mean - share * surrogate.in_sample.mean(axis=0)) / (1.0 - share) if n < size else mean
    # an outcome that is rare in the sample may come out below 0
    total = np.maximum(share * seen.mean(axis=0) + (1.0 - share) * (rest + error.mean(axis=0)), 0.0)
    of = max(float(total @ counts), 1.0 / size)
    cost = float(total @ (OUTCOME_COST * counts)) / of
    residual = error @ ((OUTCOME_COST - cost) * counts)
    sums = np.bincount(
        np.unique(surrogate.cells, return_inverse=True)[1], residual - residual.mean()
    )
    # an error of 1 and one of -1 added: a few loops that all cost the same do not show the cost
    # exactly
    half = _Z * np.sqrt((1.0 - share) * (float(sums @ sums) + 2.0)) / n / of
    return Estimate(cost, max(cost - half, 0.0), min(cost + half, 1.0))

"""How well can a classifier tell recorded loops from simulated ones? The area under its ROC curve
is a distance between two sets of records: .5 where they cannot be told apart, 1 where any can.

Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR; extremely randomised trees
by Geurts, Ernst and Wehenkel (2006), Machine Learning 63, 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbench.bench.statistics import Estimate
from simbench.detectors.compiled import one_thread

# folds in which whole units are left out, and how often they are drawn anew: what a classifier says
# depends on what it is not shown
_FOLDS = 5
_ROUNDS = 3
_TREES = 40  # of all features, in each
_FEW_TREES = 12  # of the few features of a block
_LEAF = 2  # records in a leaf
_DRAWS = 200  # of units, for the interval
_ENDS = (0.025, 0.975)


@dataclass(frozen=True)
class FeatureSample:
    """Records by their features, shape (records, features), the unit that each record belongs to,
    and the block of each feature.
    """

    features: np.ndarray
    units: tuple[str, ...]
    blocks: tuple[str, ...]

    def of(self, block: str) -> FeatureSample:
        """Return the records by the features of one block."""
        kept = [k for k, name in enumerate(self.blocks) if name == block]
        return FeatureSample(self.features[:, kept], self.units, (block,) * len(kept))


def tell_apart(simulated: FeatureSample, recorded: FeatureSample, seed: int = 0) -> Estimate:
    """Return the AUC with which records are told from simulated ones, units whole, and its 95 %
    interval by drawing units again. A record and the simulations of its loop are of one unit.
    """
    return _with_interval(_classify(simulated, recorded, seed, _TREES), seed)


def auc_of_few(simulated: FeatureSample, recorded: FeatureSample, seed: int = 0) -> float:
    """Return the AUC of `tell_apart` by the few features of a block, without its interval."""
    told = _classify(simulated, recorded, seed, _FEW_TREES)
    return float(_areas(told, told.weight[None])[0])


class _Classified(NamedTuple):
    """What a classifier says of records, (n,) each: its score, whether it was recorded, the number
    of its unit, and its weight.
    """

    score: np.ndarray
    label: np.ndarray
    units: np.ndarray
    weight: np.ndarray


def _classify(
    simulated: FeatureSample, recorded: FeatureSample, seed: int, trees: int
) -> _Classified:
    """Ask a classifier of so many trees about records that it has not learned from."""
    X = np.concatenate([simulated.features, recorded.features])
    label = np.repeat([False, True], [len(simulated.units), len(recorded.units)])
    units = np.unique([*simulated.units, *recorded.units], return_inverse=True)[1]
    weight = _weights(label, units)
    return _Classified(_out_of_fold(X, label, units, weight, seed, trees), label, units, weight)


def _weights(label: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Return weights with which every unit of a kind counts the same, and both kinds as much."""
    weight = np.empty(label.size)
    for kind in (False, True):
        own, place, count = np.unique(units[label == kind], return_inverse=True, return_counts=True)
        weight[label == kind] = 1.0 / (own.size * count[place])
    return weight


def _out_of_fold(
    X: np.ndarray,
    label: np.ndarray,
    units: np.ndarray,
    weight: np.ndarray,
    seed: int,
    trees: int,
) -> np.ndarray:
    """Return the probability of being recorded, learned on other units than it is asked about."""
    # here, for it takes a second to load
    from sklearn.ensemble import ExtraTreesClassifier

    rng = np.random.default_rng([seed, 5])
    said = np.zeros(label.size)
    of_records = np.isin(units, units[label])
    with one_thread():
        for _ in range(_ROUNDS):
            fold = np.zeros(label.size, dtype=int)
            # both kinds in every fold
            for some in (of_records, ~of_records):
                own, place = np.unique(units[some], return_inverse=True)
                fold[some] = rng.permutation(own.size)[place] % _FOLDS
            for k in range(_FOLDS):
                there = fold != k
                here = fold == k
                if here.any() and 0 < label[there].sum() < there.sum():
                    model = ExtraTreesClassifier(trees, min_samples_leaf=_LEAF, random_state=seed)
                    model.fit(X[there], label[there], weight[there])
                    said[here] += model.predict_proba(X[here])[:, 1]
    return said / _ROUNDS


def _with_interval(told: _Classified, seed: int) -> Estimate:
    """Return the area under the ROC curve and its interval, by drawing the units of each kind."""
    rng = np.random.default_rng([seed, 6])
    counts = np.zeros((_DRAWS, told.label.size))
    of_kind = [np.unique(told.units[told.label == kind]) for kind in (False, True)]
    for times in counts:
        for own in of_kind:
            drawn = own[rng.integers(0, own.size, own.size)]
            times += np.bincount(drawn, minlength=told.units.max() + 1)[told.units]
    value, *found = _areas(told, told.weight * np.vstack([np.ones(told.label.size), counts]))
    lo, hi = np.quantile(found, _ENDS)
    return Estimate(float(value), float(min(lo, value)), float(max(hi, value)))


def _areas(told: _Classified, weights: np.ndarray) -> np.ndarray:
    """Return the area under the ROC curve for each of some sets of weights, shape (sets, n): how
    likely a recorded loop scores more than a simulated one, ties half.
    """
    ours = told.score[told.label, None]
    theirs = told.score[~told.label]
    above = (ours > theirs) + 0.5 * (ours == theirs)
    recorded = weights[:, told.label]
    simulated = weights[:, ~told.label]
    with one_thread():
        pairs = (recorded @ above * simulated).sum(axis=1)
    # weights are no round numbers: an area of 1 is one
    return np.round(pairs / (recorded.sum(axis=1) * simulated.sum(axis=1)), 12)

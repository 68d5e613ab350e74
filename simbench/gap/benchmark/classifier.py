"""How well can a classifier tell recorded loops from simulated ones? The area under its ROC curve
is a distance between two sets of records: .5 where they cannot be told apart, 1 where any can.

Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR; extremely randomised trees
by Geurts, Ernst and Wehenkel (2006), Machine Learning 63, 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.bench.statistics import Estimate, area, dense_ranks
from simbench.detectors.compiled import one_thread

_FOLDS = 5  # in which whole units are left out
TREES, FEW_TREES = 100, 30  # of all features, and of the few of a block
_LEAF = 2  # records in a leaf
_DRAWS = 200  # of units, for the interval
_ENDS = (0.025, 0.975)


@dataclass(frozen=True)
class Sample:
    """Records by their features, shape (records, features), and the unit that each belongs to."""

    features: np.ndarray
    units: tuple[str, ...]


def tell_apart(simulated: Sample, recorded: Sample, seed: int = 0, trees: int = TREES) -> Estimate:
    """Return the AUC with which records are told from simulated ones, units whole, and its 95 %
    interval by drawing units again.
    """
    X = np.concatenate([simulated.features, recorded.features])
    label = np.repeat([False, True], [len(simulated.units), len(recorded.units)])
    units = np.unique(
        [*(f"s {u}" for u in simulated.units), *(f"r {u}" for u in recorded.units)],
        return_inverse=True,
    )[1]
    scores = _out_of_fold(X, label, units, seed, trees)
    return _with_interval(scores, label, units, seed)


def _out_of_fold(
    X: np.ndarray, label: np.ndarray, units: np.ndarray, seed: int, trees: int
) -> np.ndarray:
    """Return the probability of being recorded, learned on other units than it is asked about."""
    # here, for it takes a second to load
    from sklearn.ensemble import ExtraTreesClassifier

    fold, rng = np.zeros(label.size, dtype=int), np.random.default_rng([seed, 5])
    # both kinds in every fold
    for kind in (False, True):
        own, place = np.unique(units[label == kind], return_inverse=True)
        fold[label == kind] = rng.permutation(own.size)[place] % _FOLDS
    said = np.full(label.size, 0.5)
    with one_thread():
        for k in range(_FOLDS):
            there, here = fold != k, fold == k
            if here.any() and 0 < label[there].sum() < there.sum():
                model = ExtraTreesClassifier(
                    trees, min_samples_leaf=_LEAF, class_weight="balanced", random_state=seed
                )
                said[here] = model.fit(X[there], label[there]).predict_proba(X[here])[:, 1]
    return said


def _with_interval(scores: np.ndarray, label: np.ndarray, units: np.ndarray, seed: int) -> Estimate:
    value = area(dense_ranks(scores), label)
    rng, found = np.random.default_rng([seed, 6]), []
    members = {
        kind: [np.flatnonzero(units == u) for u in np.unique(units[label == kind])]
        for kind in (False, True)
    }
    for _ in range(_DRAWS):
        drawn = np.concatenate(
            [
                np.concatenate([own[i] for i in rng.integers(0, len(own), len(own))])
                for own in members.values()
            ]
        )
        found.append(area(dense_ranks(scores[drawn]), label[drawn]))
    lo, hi = np.quantile(found, _ENDS)
    return Estimate(value, float(min(lo, value)), float(max(hi, value)))

"""How well can a classifier tell recorded loops from simulated ones? The area under its ROC curve
is a distance between two sets of records: .5 where they cannot be told apart, 1 where any can.

Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR; extremely randomised trees
by Geurts, Ernst and Wehenkel (2006), Machine Learning 63, 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.bench.statistics import Estimate
from simbench.detectors.compiled import one_thread

# folds in which whole units are left out, and how often they are drawn anew: what a classifier says
# depends on what it is not shown
_FOLDS, _ROUNDS = 5, 3
TREES, FEW_TREES = 40, 12  # of all features, and of the few of a block, in each
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


def tell_apart(
    simulated: FeatureSample, recorded: FeatureSample, seed: int = 0, trees: int = TREES
) -> Estimate:
    """Return the AUC with which records are told from simulated ones, units whole, and its 95 %
    interval by drawing units again. A record and the simulations of its loop are of one unit.
    """
    X = np.concatenate([simulated.features, recorded.features])
    label = np.repeat([False, True], [len(simulated.units), len(recorded.units)])
    units = np.unique([*simulated.units, *recorded.units], return_inverse=True)[1]
    weight = _weights(label, units)
    scores = _out_of_fold(X, label, units, weight, seed, trees)
    return _with_interval(scores, label, units, weight, seed)


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

    rng, said = np.random.default_rng([seed, 5]), np.zeros(label.size)
    of_records = np.isin(units, units[label])
    with one_thread():
        for _ in range(_ROUNDS):
            fold = np.zeros(label.size, dtype=int)
            # both kinds in every fold
            for some in (of_records, ~of_records):
                own, place = np.unique(units[some], return_inverse=True)
                fold[some] = rng.permutation(own.size)[place] % _FOLDS
            for k in range(_FOLDS):
                there, here = fold != k, fold == k
                if here.any() and 0 < label[there].sum() < there.sum():
                    model = ExtraTreesClassifier(trees, min_samples_leaf=_LEAF, random_state=seed)
                    model.fit(X[there], label[there], weight[there])
                    said[here] += model.predict_proba(X[here])[:, 1]
    return said / _ROUNDS


def _with_interval(
    scores: np.ndarray, label: np.ndarray, units: np.ndarray, weight: np.ndarray, seed: int
) -> Estimate:
    from sklearn.metrics import roc_auc_score

    value = float(roc_auc_score(label, scores, sample_weight=weight))
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
        found.append(roc_auc_score(label[drawn], scores[drawn], sample_weight=weight[drawn]))
    lo, hi = np.quantile(found, _ENDS)
    return Estimate(value, float(min(lo, value)), float(max(hi, value)))

"""What is learned on some groups of loops and judged on the others: thresholds, and the probability
of a label.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.compiled import one_thread

# scenarios; the 95 % interval of an area under a curve is then about .01 wide
MOST_ORDERED = 20_000
_FOLDS = 5
_ALARMS = 0.05  # share of false positives at which sensitivity_at_5 is taken
_LEAST = 100  # loops below which gradient boosting has nothing to split
# trees, and leaves of each: with twice the trees of four times the leaves the AUC of 12 sets of
# loops is .54 as well, where noise is asked for .998, and it takes four times as long
_TREES = 50
_LEAVES = 8
_MOST = 5_000  # loops that it learns from; of more these are drawn at random


def sample_of(groups: np.ndarray) -> np.ndarray:
    """Return the loops on which orders and scatter are worked out: all, of a large run those of
    groups drawn at random, `MOST_ORDERED` or a few more.
    """
    place = np.unique(groups, return_inverse=True)[1]
    sizes = np.bincount(place)
    order = np.random.default_rng(0).permutation(sizes.size)
    kept = np.empty(sizes.size, dtype=bool)
    kept[order] = np.cumsum(sizes[order]) - sizes[order] < MOST_ORDERED
    return np.flatnonzero(kept[place])


def folds_of(groups: np.ndarray) -> np.ndarray:
    """Return a fold (0 to 4) for every loop; groups stay whole."""
    unique, place = np.unique(groups, return_inverse=True)
    return np.random.default_rng(0).permutation(unique.size)[place] % _FOLDS


def found_at(
    ranks: np.ndarray, positive: np.ndarray, fold: np.ndarray, alarms: float = _ALARMS
) -> int:
    """Count positives above a threshold that lets so many false positives through on the other
    folds.
    """
    found = 0
    for k in range(_FOLDS):
        healthy = ranks[(fold != k) & ~positive]
        # nothing to learn a threshold from: nothing is found
        cut = ranks.max(initial=0)
        if healthy.size:
            place = healthy.size - 1 - int(alarms * healthy.size)
            cut = np.partition(healthy, place)[place]
        found += int((ranks[(fold == k) & positive] > cut).sum())
    return found


def out_of_fold(features: np.ndarray, label: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the probability of a label by gradient boosting on one thread, learned on other groups
    than it is asked about.
    """
    arrays = (np.asarray(features, float), label > 0, folds_of(groups))
    return _boost_folds(features.shape[1], *(x.tobytes() for x in arrays)).copy()


# `run` scores what it wrote, and then what it reads: the two classifiers learn once
@lru_cache(maxsize=2)
def _boost_folds(
    columns: int, feature_bytes: bytes, label_bytes: bytes, fold_bytes: bytes
) -> np.ndarray:
    """Return what `out_of_fold` does, of folds, for arrays of floats, bools and integers."""
    label = np.frombuffer(label_bytes, bool)
    fold = np.frombuffer(fold_bytes, int)
    features = np.frombuffer(feature_bytes).reshape(-1, columns)
    said = np.full(label.size, 0.5)
    learned = []
    for k in np.unique(fold):
        there = fold != k
        here = fold == k
        if there.any():
            said[here] = label[there].mean()
        if label.size >= _LEAST and 0 < label[there].sum() < there.sum():
            chosen = np.flatnonzero(there)
            if chosen.size > _MOST:
                chosen = np.sort(np.random.default_rng(0).choice(chosen, _MOST, replace=False))
            learned.append((chosen, here))
    if learned:
        # here, for it takes a second to load
        from sklearn.ensemble import HistGradientBoostingClassifier

        # two threads on a busy machine wait for each other for minutes
        with one_thread():
            for there, here in learned:
                model = HistGradientBoostingClassifier(
                    max_iter=_TREES, max_leaf_nodes=_LEAVES, random_state=0
                )
                model.fit(features[there], label[there])
                said[here] = model.predict_proba(features[here])[:, 1]
    return said

"""How well can a classifier tell recorded loops from simulated ones? The area under its ROC curve
is a distance between two sets of records: .5 where they cannot be told apart, 1 where any can.

Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR; extremely randomised trees
by Geurts, Ernst and Wehenkel (2006), Machine Learning 63, 3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simbench.bench.statistics import Estimate, auc
from simbench.detectors.compiled import one_thread

_FOLDS = 5  # in which whole units are left out
_TREES = 60
_LEAF = 2  # records in a leaf


def tell_apart(
    simulated: np.ndarray,
    recorded: np.ndarray,
    units: Sequence[str],
    seed: int = 0,
) -> tuple[Estimate, float]:
    """Return the AUC with which records are told from simulated ones by their features, shape
    (records, features) each, and the mean probability that the classifier gives to what is true.

    `units`, of the simulated ones first: a record is asked about by what was learned on others.
    """
    # here, for it takes a second to load
    from sklearn.ensemble import ExtraTreesClassifier
    from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict

    features = np.concatenate([simulated, recorded])
    label = np.repeat([False, True], [len(simulated), len(recorded)])
    model = ExtraTreesClassifier(
        _TREES, min_samples_leaf=_LEAF, class_weight="balanced", random_state=seed
    )
    folds = StratifiedGroupKFold(_FOLDS, shuffle=True, random_state=seed)
    with one_thread():
        p = cross_val_predict(
            model, features, label, groups=units, cv=folds, method="predict_proba"
        )[:, 1]
    # both kinds count as much
    certain = 0.5 * (p[label].mean() + 1.0 - p[~label].mean())
    return auc(p, label), float(certain)

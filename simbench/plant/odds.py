"""How probable stiction is, given all verdicts and scores of a record: a logistic model learned on the record's own twins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

FOLDS = 5
STRENGTHS = (0.003, 0.01, 0.03, 0.1)  # inverse penalties tried; all shrink, few twins teach many numbers
TEMPERATURES = np.geomspace(0.5, 4.0, 25)
EDGE = 0.98  # no probability from a few hundred twins is surer than this


@dataclass(frozen=True, eq=False)
class Odds:
    """A model of stiction, and what it says of the twins it was not shown.

    Parameters
    ----------
    model : object
        The fitted classifier.
    temperature : float
        By which its log-odds are divided; above 1 it was too sure of itself.
    of_twins : ndarray, shape (twins,)
        Probability of every twin by a model that has not seen it.
    """

    model: Any
    temperature: float
    of_twins: np.ndarray

    def of(self, features: np.ndarray) -> np.ndarray:
        """Return the probability of stiction of records, shape (records,)."""
        return _bounded(self.model.decision_function(features) / self.temperature)


def learn(features: np.ndarray, sticky: np.ndarray, weight: np.ndarray) -> Odds:
    """Learn the probability of stiction from twins.

    Parameters
    ----------
    features : ndarray, shape (twins, features)
        As `ScoreScales.features` gives them.
    sticky : ndarray of bool, shape (twins,)
        Truth.
    weight : ndarray, shape (twins,)
        What every twin counts; sticky and healthy ones should sum to the same, which makes the prior odds even.

    Returns
    -------
    Odds

    Notes
    -----
    Penalty and temperature are those with the smallest log-loss on twins left out. The classifier is linear: a record's
    probability can be traced to the detectors that moved it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> sticky = np.arange(100) < 50
    >>> x = rng.standard_normal((100, 3)) + 2.0 * sticky[:, None]
    >>> odds = learn(x, sticky, np.ones(100))
    >>> bool(odds.of(np.array([[2.0, 2.0, 2.0]]))[0] > 0.9)
    True
    """
    from sklearn.linear_model import LogisticRegression

    # neighbours in the list are of one kind: every fold takes from all
    fold = np.arange(sticky.size) % FOLDS
    best = (np.inf, STRENGTHS[0], np.zeros(sticky.size))
    for strength in STRENGTHS:
        out = np.zeros(sticky.size)
        for i in range(FOLDS):
            model = LogisticRegression(C=strength, max_iter=300)
            model.fit(features[fold != i], sticky[fold != i], sample_weight=_even(weight[fold != i]))
            out[fold == i] = model.decision_function(features[fold == i])
        loss = _log_loss(_bounded(out), sticky, weight)
        if loss < best[0]:
            best = (loss, strength, out)
    losses = [_log_loss(_bounded(best[2] / t), sticky, weight) for t in TEMPERATURES]
    temperature = float(TEMPERATURES[int(np.argmin(losses))])
    model = LogisticRegression(C=best[1], max_iter=300).fit(features, sticky, sample_weight=_even(weight))
    return Odds(model, temperature, _bounded(best[2] / temperature))


def even_weights(S: np.ndarray, counted: np.ndarray | None = None) -> np.ndarray:
    """Return weights by which healthy twins (S = 0) and sticky ones count the same in sum, shape (twins,).

    Parameters
    ----------
    S : ndarray, shape (twins,)
    counted : ndarray of bool, shape (twins,), optional
        Which twins count at all.

    Returns
    -------
    ndarray
    """
    every = np.ones(S.size, dtype=bool) if counted is None else counted
    sticky, sound = every & (S > 0), every & (S <= 0)
    return sticky * (0.5 / max(sticky.sum(), 1)) + sound * (0.5 / max(sound.sum(), 1))


def _even(weight: np.ndarray) -> np.ndarray:
    return weight * (weight.size / weight.sum())


def _bounded(logit: np.ndarray) -> np.ndarray:
    p = 1.0 / (1.0 + np.exp(-np.clip(logit, -30.0, 30.0)))
    return np.clip(p, 1.0 - EDGE, EDGE)


def _log_loss(p: np.ndarray, sticky: np.ndarray, weight: np.ndarray) -> float:
    return float(-np.sum(weight * np.log(np.where(sticky, p, 1.0 - p))))

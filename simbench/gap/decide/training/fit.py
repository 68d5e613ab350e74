"""Grow the trees that weigh evidence: `python -m simbench.gap.decide.training.fit DIR`, DIR from `make`.

Two models: one ranks the 22 effects and none against each other, one says whether something unknown is there. Their scores
become probabilities by a temperature, a slope and an offset fitted on cases that the trees did not see, and by the bias
towards none that keeps false alarms rare on them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from simbench.calibration import calibration_error
from simbench.gap.decide.classify import LEARNED, candidate_rows, combined, record_row
from simbench.gap.decide.training.make import load
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN
from simbench.usage import exit_code

FOLDS = 5
FALSE_ALARMS = 0.05  # share of records without effect on which one may be named
ANSWERS = (*EFFECTS, NONE, UNKNOWN)
COMMON = {
    "learning_rate": 0.06, "lambda_l2": 3.0, "feature_fraction": 0.3, "bagging_fraction": 0.8, "bagging_freq": 1,
    "num_threads": 1, "deterministic": True, "force_row_wise": True, "seed": 0, "verbose": -1,
}  # fmt: skip
RANKING = {**COMMON, "num_leaves": 12, "min_data_in_leaf": 30, "max_cat_to_onehot": 30}
OUTSIDE = {**COMMON, "num_leaves": 8, "min_data_in_leaf": 12, "objective": "binary"}
ROUNDS = {"known": 300, "unknown": 150}


def truth(example: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the right answers of a case: one, or two effects.

    Parameters
    ----------
    example : mapping
        From `make.example`.

    Returns
    -------
    tuple of str
    """
    return (UNKNOWN,) if example["foreign"] else tuple(example["effects"]) or (NONE,)


def fit(examples: Sequence[Mapping[str, Any]]) -> tuple[Any, Any, dict[str, Any]]:
    """Train both models and calibrate them.

    Parameters
    ----------
    examples : sequence of dict
        From `make.load`; some thousand.

    Returns
    -------
    known, unknown : lightgbm.Booster
    calibration : dict
        Names of the columns, the four numbers of `classify.combined`, and what cross-validation found.

    Notes
    -----
    Listwise softmax as objective (Cao et al. 2007): every record weighs the same, and the scores of one record's answers
    compete with each other only. Not a way to judge the diagnosis: that is the blind check's work.
    """
    record = sorted({k for e in examples for k in e["evidence"]["record"]})
    effect = sorted({k for e in examples for name in EFFECTS for k in e["evidence"][name]})
    columns = (list(EFFECTS), record, effect)
    X = np.array([candidate_rows(e["evidence"], *columns) for e in examples])
    R = np.array([record_row(e["evidence"], *columns) for e in examples])
    right = [truth(e) for e in examples]
    Y = np.array([[float(a in t) for a in ANSWERS] for t in right])
    fold = np.arange(len(examples)) % FOLDS
    z, u = np.empty((len(examples), len(ANSWERS) - 1)), np.empty(len(examples))
    for k in range(FOLDS):
        known, unknown = _grow(X[fold != k], R[fold != k], Y[fold != k])
        z[fold == k] = _ranked(known, X[fold == k])
        u[fold == k] = unknown.predict(R[fold == k], raw_score=True)

    def surprise(v: np.ndarray) -> float:
        p = combined(z, u, float(np.exp(v[0])), v[1], v[2])
        return -float(np.mean(np.log((p * Y).sum(axis=1) + 1e-9)))

    best = minimize(surprise, [0.0, 1.0, 0.0], method="Nelder-Mead")
    numbers = {"temperature": float(np.exp(best.x[0])), "slope": float(best.x[1]), "offset": float(best.x[2])}
    none = np.array([t == (NONE,) for t in right])
    numbers["none_bias"] = none_bias(combined(z, u, **numbers)[none]) if none.any() else 0.0
    p = combined(z, u, **numbers)
    known, unknown = _grow(X, R, Y)
    return (
        known,
        unknown,
        {**numbers, "effects": list(EFFECTS), "record": record, "effect": effect, "found": _found(examples, right, p)},
    )


def none_bias(p: np.ndarray) -> float:
    """Return the logit by which none must be favoured for an effect to be named on so few records without one.

    Parameters
    ----------
    p : ndarray, shape (records, 24)
        Probabilities on records without effect.

    Returns
    -------
    float
        Not below 0.
    """
    lead = np.log(p[:, : len(EFFECTS)].max(axis=1)) - np.log(p[:, len(EFFECTS)])
    # where unknown wins, no effect is named
    lead = np.where(p[:, -1] > p[:, :-1].max(axis=1), -np.inf, lead)
    return max(0.0, float(np.quantile(lead, 1.0 - FALSE_ALARMS, method="higher")))


def _grow(X: np.ndarray, R: np.ndarray, Y: np.ndarray) -> tuple[Any, Any]:
    import lightgbm

    alien = Y[:, -1] > 0
    X, Y = X[~alien], Y[~alien, :-1]
    lines = lightgbm.Dataset(X.reshape(-1, X.shape[2]), label=Y.ravel(), categorical_feature=[0, 1])
    known = lightgbm.train({**RANKING, "objective": listwise(Y)}, lines, num_boost_round=ROUNDS["known"])
    strange = lightgbm.Dataset(R, label=alien.astype(float), categorical_feature=[0])
    return known, lightgbm.train(OUTSIDE, strange, num_boost_round=ROUNDS["unknown"])


def listwise(Y: np.ndarray) -> Callable:
    """Return gradient and curvature of the softmax's cross entropy over each record's answers.

    Parameters
    ----------
    Y : ndarray, shape (records, answers)
        1 where an answer is right; two right ones share their weight.

    Returns
    -------
    function (scores, dataset) -> gradient, curvature
    """
    share = Y / Y.sum(axis=1, keepdims=True)

    def objective(scores: np.ndarray, _: Any) -> tuple[np.ndarray, np.ndarray]:
        z = scores.reshape(share.shape)
        p = np.exp(z - z.max(axis=1, keepdims=True))
        p /= p.sum(axis=1, keepdims=True)
        return (p - share).ravel(), np.maximum(p * (1.0 - p), 1e-3).ravel()

    return objective


def _ranked(known: Any, X: np.ndarray) -> np.ndarray:
    return known.predict(X.reshape(-1, X.shape[2]), raw_score=True).reshape(len(X), -1)


def _found(examples: Sequence[Mapping[str, Any]], right: Sequence[tuple[str, ...]], p: np.ndarray) -> dict[str, float]:
    """Return shares of right answers in cross-validation."""
    first = [ANSWERS[i] for i in p.argmax(axis=1)]
    hit = np.array([f in t for f, t in zip(first, right)])
    one = np.array([len(e["effects"]) == 1 for e in examples])
    plain = np.array([e["strength"] in ("medium", "strong") for e in examples])
    none, alien = (np.array([t == (a,) for t in right]) for a in (NONE, UNKNOWN))
    sure, said = p.max(axis=1), np.array(first)
    return {
        "cases": len(examples),
        "one effect, medium or strong: named": float(hit[one & plain].mean()),
        "one effect, medium or strong: called unknown": float((said[one & plain] == UNKNOWN).mean()),
        "none: an effect named": float(((said[none] != NONE) & (said[none] != UNKNOWN)).mean()),
        "foreign: called unknown": float(hit[alien].mean()),
        "expected calibration error": calibration_error(sure, hit),
    }


def main(arguments: list[str] | None = None) -> int:
    """Train from a folder, write the models beside the code that uses them, print what cross-validation found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=LEARNED)
    given = parser.parse_args(arguments)
    known, unknown, calibration = fit(load(given.folder))
    given.output.mkdir(parents=True, exist_ok=True)
    known.save_model(given.output / "known.txt")
    unknown.save_model(given.output / "unknown.txt")
    (given.output / "calibration.json").write_text(json.dumps(calibration, indent=1) + "\n", encoding="utf-8")
    for name, value in calibration["found"].items():
        print(f"{name:48s} {value:.3f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

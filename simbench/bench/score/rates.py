"""Rates of a method's answers, and the counts that they are made of."""

from __future__ import annotations

import math

import numpy as np

from simbench.bench.score.answers import Answers
from simbench.bench.statistics import wilson

# with Wilson intervals, in the order they are shown
RATES = (
    "accuracy",
    "accuracy_decided",
    "no_decision",
    "sensitivity",
    "false_positives",
    "accuracy_all",
)


def coded(a: Answers) -> np.ndarray:
    """Return each answer as one number: what was said, whether the method applies, and whether it
    failed.
    """
    return ((a.said & 3) * 2 + a.applies) * 2 + a.failed


def counted(place: np.ndarray, shape: tuple[int, ...], codes: list[np.ndarray]) -> list[np.ndarray]:
    """Count the answers of every method by place, what was said, whether it applies and whether it
    failed.
    """
    size = math.prod(shape) * 16
    return [np.bincount(16 * place + c, minlength=size).reshape(*shape, 4, 2, 2) for c in codes]


def rates_of(counts: np.ndarray) -> dict[str, float]:
    """Return the rates of one method's answers, counted by truth (unknown, no, yes) and code, with
    their 95 % intervals.
    """
    no, yes = counts[1:, :, 1].sum(-1).tolist()
    n, m, p = int(counts[1:].sum()), sum(no) + sum(yes), sum(yes)
    right, undecided = no[0] + yes[1], no[2] + yes[2]
    # where a method does not apply it does not decide: nothing right is added
    of = (
        (right, m),
        (right, m - undecided),
        (undecided, m),
        (yes[1], p),
        (no[1], m - p),
        (right, n),
    )
    rates: dict[str, float] = {}
    lo, hi = (bound.tolist() for bound in wilson(*zip(*of, strict=True)))
    for name, (hits, trials), *ends in zip(RATES, of, lo, hi, strict=True):
        rates[name] = hits / trials if trials else math.nan
        rates[f"{name}_lo"], rates[f"{name}_hi"] = ends
    return rates

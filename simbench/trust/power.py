"""Compute for each detector, from simulated replicates of a loop, false-positive rate, sensitivity
over S and J, an advised threshold, and the smallest visible stiction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from simbench.bench.statistics import wilson
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

POWER = 0.8  # sensitivity from which a size is called visible
_ALARMS = 0.05  # share of healthy replicates that a threshold chosen here may call sticky
# by which a threshold chosen here must be right more often than the published rule to be advised
_BETTER = 0.03


@dataclass(frozen=True)
class Cell:
    """Share of the replicates with one S and J (% of travel) called stiction, and its 95 %
    interval.
    """

    S: float
    J: float
    share: float
    lo: float
    hi: float


@dataclass(frozen=True)
class Rule:
    """How a method should be read on this loop: by its published rule, or by the score above which
    stiction is called.

    `right` is the share of replicates answered right, sticky and healthy ones counting the same; an
    abstention is not right.
    """

    method: str
    cut: float | None
    right: float

    def verdict_of(self, verdict: Verdict) -> str:
        """Return what this rule reads out of a verdict."""
        if self.cut is None:
            return verdict.verdict
        return (
            STICTION
            if verdict.score > self.cut
            else NO_STICTION
            if np.isfinite(verdict.score)
            else NO_DECISION
        )

    def calls(self, verdict: Verdict) -> bool:
        """Return whether this rule calls a verdict stiction."""
        return self.verdict_of(verdict) == STICTION


def cells_of(S: np.ndarray, J: np.ndarray, called: np.ndarray) -> list[Cell]:
    """Return the share called sticky in every cell (S, J) of the sticky replicates."""
    keys = sorted({(round(j / s, 6), s, j) for s, j in zip(S, J) if s > 0})
    out = []
    for _, s, j in keys:
        here = called[(s == S) & (j == J)]
        lo, hi = wilson(here.sum(), here.size)
        out.append(Cell(float(s), float(j), float(here.mean()), float(lo), float(hi)))
    return out


def smallest_visible(cells: Sequence[Cell]) -> tuple[float, float] | None:
    """Return the smallest S, with its J, from which on the sensitivity reaches `POWER`."""
    best = None
    for ratio in sorted({round(c.J / c.S, 6) for c in cells}):
        line = sorted((c for c in cells if round(c.J / c.S, 6) == ratio), key=lambda c: c.S)
        grown = scipy.optimize.isotonic_regression([c.share for c in line]).x
        if grown[-1] < POWER:
            continue
        first = int(np.argmax(grown >= POWER))
        S = line[first].S
        if first > 0:
            a, b = grown[first - 1], grown[first]
            S = float(np.exp(np.interp(POWER, [a, b], np.log([line[first - 1].S, S]))))
        if best is None or S < best[0]:
            best = (S, ratio * S)
    return best


def readings(method: str, verdicts: Sequence[Verdict], sticky: np.ndarray) -> list[Rule]:
    """Return the readings of a method here: its published rule, and a threshold on its score
    that healthy replicates set.
    """
    called = np.array([v.verdict == STICTION for v in verdicts])
    undecided = np.array([v.verdict == NO_DECISION for v in verdicts])
    published = Rule(method, None, _right(called, sticky, ~undecided))
    # what could not be scored is no alarm, and no finding either
    scores = np.array([v.score if v.score == v.score else -np.inf for v in verdicts])
    cut = _cut(scores[~sticky])
    if not np.isfinite(cut):
        return [published]
    half = np.arange(sticky.size) % 2 == 0
    tried = [
        _right(scores[here] > _cut(scores[~here & ~sticky]), sticky[here]) for here in (half, ~half)
    ]
    chosen = Rule(method, cut, float(np.mean(tried)))
    return [chosen, published] if chosen.right > published.right + _BETTER else [published, chosen]


def _right(called: np.ndarray, sticky: np.ndarray, decided: np.ndarray | None = None) -> float:
    quiet = ~called if decided is None else ~called & decided
    return 0.5 * (float(called[sticky].mean()) + float(quiet[~sticky].mean()))


def _cut(healthy: np.ndarray) -> float:
    return float(np.quantile(healthy, 1.0 - _ALARMS, method="higher"))


def likelihood_ratio(verdict: str, verdicts: Sequence[str], sticky: np.ndarray) -> float:
    """Return how much more often sticky replicates get this verdict than healthy ones; half a
    replicate is added to each count.
    """
    same = np.array([v == verdict for v in verdicts])
    return float(
        ((same[sticky].sum() + 0.5) / (sticky.sum() + 1.5))
        / ((same[~sticky].sum() + 0.5) / ((~sticky).sum() + 1.5))
    )

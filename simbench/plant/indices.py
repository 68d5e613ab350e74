"""Verdicts and scores of several detectors on many records, as one table of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detectors.judge import judge
from detectors.record import LoopRecord
from detectors.registry import methods as registry
from detectors.verdict import NO_DECISION, STICTION, Verdict

QUIET = -3.0  # standard deviations below the mean at which a record without oscillation stands


def judged(record: LoopRecord, methods: Sequence[str]) -> list[Verdict]:
    """Judge one record by every method; one that fails abstains.

    Parameters
    ----------
    record : LoopRecord
    methods : sequence of str

    Returns
    -------
    list of Verdict
    """
    for name in methods:
        registry.load(name)
    try:
        return judge(record, methods)
    except (ArithmeticError, ValueError, IndexError):
        return [_alone(record, m) for m in methods]


def _alone(record: LoopRecord, method: str) -> Verdict:
    try:
        return judge(record, [method])[0]
    except (ArithmeticError, ValueError, IndexError) as error:
        return Verdict(method, NO_DECISION, reason=f"failed: {type(error).__name__}")


@dataclass(frozen=True, eq=False)
class ScoreScales:
    """How scores become comparable: their mean and spread on the twins; learned once, used on twins and record alike."""

    mean: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(cls, many: Sequence[Sequence[Verdict]]) -> ScoreScales:
        """Return the scales of the verdicts of many records."""
        scores = _scores(many)
        known = np.isfinite(scores)
        count = np.maximum(known.sum(axis=0), 1)
        mean = np.where(known, scores, 0.0).sum(axis=0) / count
        spread = np.sqrt((np.where(known, scores - mean, 0.0) ** 2).sum(axis=0) / count)
        return cls(mean, np.where(spread > 0, spread, 1.0))

    def features(self, many: Sequence[Sequence[Verdict]]) -> np.ndarray:
        """Return verdicts and scores as numbers.

        Parameters
        ----------
        many : sequence of lists of Verdict
            The same methods in the same order for every record.

        Returns
        -------
        ndarray, shape (records, 2 methods)
            First -1, 0 or 1 per verdict, then the score in standard deviations, within +-3; what could not be scored is 0,
            what did not oscillate stands at the lower end.
        """
        scores = (_scores(many) - self.mean) / self.spread
        scores = np.where(np.isnan(scores), 0.0, np.clip(scores, QUIET, -QUIET))
        says = np.array([[{STICTION: 1.0, NO_DECISION: 0.0}.get(v.verdict, -1.0) for v in row] for row in many])
        return np.hstack([says, scores])


def _scores(many: Sequence[Sequence[Verdict]]) -> np.ndarray:
    return np.array([[v.score for v in row] for row in many], dtype=float)

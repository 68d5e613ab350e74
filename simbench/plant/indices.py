"""Verdicts of several detectors on one record; one that fails abstains."""

from __future__ import annotations

from collections.abc import Sequence

from detectors.judge import judge
from detectors.plugins.registry import methods as registry
from detectors.record import LoopRecord
from detectors.verdict import NO_DECISION, Verdict


def judged(record: LoopRecord, methods: Sequence[str]) -> list[Verdict]:
    """Judge one record by every method; one that fails abstains."""
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

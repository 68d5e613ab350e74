"""Data quality: is the record fit to be judged, and what would mislead a method? Flags with their evidence."""

from __future__ import annotations

from dataclasses import dataclass

from detectors.record import LoopRecord


@dataclass(frozen=True)
class Flag:
    """One finding about the data; `evidence` is a sentence with the number behind it."""

    name: str
    evidence: str


def inspect(record: LoopRecord) -> dict[str, Flag]:
    """Return the flags that a record raises, by name."""
    return {}

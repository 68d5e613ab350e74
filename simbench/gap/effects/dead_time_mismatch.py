"""Recognise a dead-time mismatch: fit Td, which other fits keep near the baseline's."""

from __future__ import annotations

from simbench.gap.effects._mismatch import dead_times, release_number
from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return the dead time beyond the baseline's (s); an OP archived late hides a sample of it."""
    return {"extra": (fit.theta["Td"] + s.data.late - s.data.Td) * s.record.Ts}


RECOGNISER = Recogniser(
    fit=release_number("Td", dead_times),
    numbers=numbers,
    needs=frozenset({"plant"}),
)

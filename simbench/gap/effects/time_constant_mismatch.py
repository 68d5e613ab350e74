"""Recognise a time-constant mismatch: fit T, which other fits keep near the baseline's."""

from __future__ import annotations

from simbench.gap.effects._mismatch import release_number, times
from simbench.gap.effects._recogniser import Recogniser, clip

RECOGNISER = Recogniser(
    fit=release_number("T", times),
    numbers=lambda fit, s: {"factor": clip(fit.theta["T"] / s.data.T, 0.05, 20.0)},
    needs=frozenset({"plant", "time constant"}),
)

"""Recognise a sensor lag: fit one additional pole that smooths the noise as well."""

from __future__ import annotations

from simbench.gap.effects._pole import pole, tau
from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    fit=pole("sensor"),
    numbers=tau,
    needs=frozenset({"plant"}),
)

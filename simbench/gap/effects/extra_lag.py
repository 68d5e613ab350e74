"""Recognise an extra lag: fit one additional pole downstream of the plant."""

from __future__ import annotations

from simbench.gap.effects._pole import pole, tau
from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    fit=pole("extra"),
    numbers=tau,
    needs=frozenset({"plant"}),
)

"""Recognise an error dead-band: OP does not change while, and only while, the error is small."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    # where PV stands while OP moves on, it is the sensor that rests
    proven=lambda s: {"width": s.law.gap} if s.law.gap > 0.0 and not s.frozen else None,
)

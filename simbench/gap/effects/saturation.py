"""Recognise saturation: OP stays at one value while the controller law would move it further."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.limits is None else {"lo": s.law.limits[0], "hi": s.law.limits[1]}
    ),
)

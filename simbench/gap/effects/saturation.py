"""Saturation recognised: OP stays at one value while the controller's law pushes outward."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.limits is None else {"lo": s.law.limits[0], "hi": s.law.limits[1]}
    ),
    explains="limits",
)

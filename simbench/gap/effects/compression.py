"""Recognise compression: PV lies on straight lines wherever it differs from what the controller
saw.
"""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    proven=lambda s: {"band": s.archive.band} if s.archive.band > 0.0 else None,
)

"""Compression recognised: PV runs on straight lines wherever it is not what the controller saw."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._draw import Size, Yardstick, between
from simbench.gap.effects._recogniser import Recogniser


def draw(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the band."""
    return lambda x: {"band": between(x, 0.1 * y.noise, 5 * y.pv)}


RECOGNISER = Recogniser(
    proven=lambda s: {"band": s.archive.band} if s.archive.band > 0.0 else None,
    explains="band",
    draw=draw,
)

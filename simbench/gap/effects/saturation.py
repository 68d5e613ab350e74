"""Saturation recognised: OP stands at one value while the controller's law pushes outward."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._draw import Size, Yardstick, between
from simbench.gap.effects._recogniser import Parameters, Recogniser


def draw(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw the side; size is the share of the time in which OP would go further."""
    side = str(rng.choice(["lo", "hi", "both"], p=[0.4, 0.4, 0.2]))

    def of(x: float) -> Parameters:
        share = between(x, 0.0005, 0.45)
        low, high = (float(q) for q in np.quantile(y.record.op, [share, 1 - share]))
        high = max(high, low + 0.01)
        return {"lo": low if side != "hi" else 0.0, "hi": high if side != "lo" else 100.0}

    return of


RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.limits is None else {"lo": s.law.limits[0], "hi": s.law.limits[1]}
    ),
    explains="limits",
    draw=draw,
)

"""What lattices of PV and OP share: how many levels are met."""

from __future__ import annotations

import numpy as np

from simbench.gap.sensor.spacing import spacing


def levels_of(x: np.ndarray) -> str:
    """Return on how many levels a signal stands, and how far apart; "" where it stands on none."""
    step, levels = spacing(x)
    if step == 0.0:
        return ""
    return f"{x.size} samples on {levels} levels, {step:.3g} apart ({step / float(x.std()):.1%} of the standard deviation)"

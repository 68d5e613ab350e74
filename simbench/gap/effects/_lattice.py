"""What lattices of PV and OP share: how much a step hides, and how many levels are met."""

from __future__ import annotations

import numpy as np

from simbench.gap.sensor.spacing import spacing

IMMATERIAL = 0.01  # of the variance of the moves; rounding that adds less is not what a simulation lacks


def hides_nothing(step: float, x: np.ndarray) -> bool:
    """Return whether rounding to a step adds next to nothing to a signal's moves."""
    return step**2 / 12.0 < IMMATERIAL * float(np.var(np.diff(x)))


def levels_of(x: np.ndarray) -> str:
    """Return on how many levels a signal stands, and how far apart; "" where it stands on none."""
    step, levels = spacing(x)
    if step == 0.0:
        return ""
    return f"{x.size} samples on {levels} levels, {step:.3g} apart ({step / float(x.std()):.1%} of the standard deviation)"

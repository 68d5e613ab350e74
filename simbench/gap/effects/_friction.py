"""What stiction and dead-band share: a healthy valve's allowance, and when the two look alike."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from simbench.gap.effects._size import LoopSize
from simbench.gap.likelihood.valve_map import HEALTHY
from simbench.gap.situation import Circumstances


def beyond_healthy(p: Mapping[str, float | str]) -> float:
    """Return how far a band exceeds what a healthy valve may have, from 0 to 1."""
    return float(np.clip((float(p["S"]) - HEALTHY) / (0.5 * HEALTHY), 0.0, 1.0))


def jitter_hides_the_jump(c: Circumstances) -> bool:
    """Return whether OP jitters by more than the valve jumps, so that a jump does not show."""
    return c.slip is not None and c.op_jitter > c.slip and not c.mv


def band(p: Mapping[str, float | str], loop: LoopSize) -> dict[str, float]:
    """Return a band in proportion to the loop, and to what a healthy valve may have."""
    return {"size": loop.travel(p["S"]), "beyond healthy": float(np.log(max(float(p["S"]), 1e-3) / HEALTHY))}

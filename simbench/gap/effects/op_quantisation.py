"""OP quantisation recognised: OP stands on a lattice that the law behind it does not explain."""

from __future__ import annotations

import numpy as np

from detectors.signal.lattice import hides_nothing
from simbench.gap.effects._draw import Size, Yardstick, between
from simbench.gap.effects._lattice import levels_of
from simbench.gap.effects._recogniser import Recogniser


def draw(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the step."""
    return lambda x: {"step": min(between(x, 0.1 * y.op_change, 15 * max(y.op_change, 0.3 * y.op)), 20.0)}


RECOGNISER = Recogniser(
    proven=lambda s: {"step": s.law.step} if s.law.step > 0.0 and not hides_nothing(s.law.step, s.op) else None,
    claims="step",
    remark=lambda s: levels_of(np.asarray(s.record.op), np.asarray(s.record.pv)),
    draw=draw,
)

"""From x in 0..1 to an effect's parameters: barely to grossly present, in proportion to the loop it
acts in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from detectors.record import LoopRecord

Size = Callable[[float], dict[str, float | str]]


@dataclass(frozen=True, eq=False)
class Yardstick:
    """How large things are in a loop that an effect is drawn for."""

    record: LoopRecord  # of the loop without effect
    noise: float  # standard deviation of the measurement noise (PV units)
    # lag, pace: T + Td of the plant and time scale of the closed loop (s)
    lag: float
    pace: float
    gain: float  # PV units that 1 % brings within the plant's time scale
    Td: float  # dead time (s) that shows in the archive
    integral: bool  # whether the controller has an integral

    @property
    def op(self) -> float:
        """Standard deviation of OP (%)."""
        return max(float(self.record.op.std()), 0.05)

    @property
    def op_change(self) -> float:
        """Standard deviation of OP from sample to sample (%)."""
        return max(float(np.diff(self.record.op).std()), 1e-3)

    @property
    def pv(self) -> float:
        """Robust standard deviation of the control error (PV units)."""
        e = self.record.e
        return 1.4826 * float(np.median(np.abs(e - np.median(e))))

    @property
    def seconds(self) -> float:
        """Length of the record (s)."""
        return self.record.duration


def between(x: float, low: float, high: float) -> float:
    """Return low at x = 0, high at x = 1, geometrically in between."""
    return float(low * (high / low) ** x)


def lag(y: Yardstick, rng: np.random.Generator) -> Size:
    """Return the time constant of one more series pole."""
    return lambda x: {"tau": between(x, 0.03, 8.0) * y.lag}


def ratio(high: float) -> Callable[[Yardstick, np.random.Generator], Size]:
    """Return a draw of a factor up to `high`, either way."""

    def draw(y: Yardstick, rng: np.random.Generator) -> Size:
        way = rng.choice([-1, 1])
        return lambda x: {"factor": between(x, 1.05, high) ** way}

    return draw

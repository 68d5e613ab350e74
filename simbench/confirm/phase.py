"""Measure period and amplitude of an oscillating OP, with the error of the period."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.detectors.signal.holds import holds
from simbench.detectors.signal.oscillation import oscillation_of

_SMALLEST = 0.01  # amplitude of OP (%) below which there is nothing to see
_BAND = 0.5  # of OP's std, which it must cross for a new cycle to begin
_WIDE = 1.96  # standard errors on either side of a 95 % interval


@dataclass(frozen=True, eq=False)
class Phase:
    """An oscillation before or after the change of gain."""

    Kc: float  # controller gain (% per PV unit)
    period: float  # s; NaN when there is no sustained oscillation
    amplitude: float  # of OP (%), as sqrt(2) times its standard deviation
    # whether OP rests at its lowest or highest value for more than 2 % of the time: at 0 or 100,
    # or elsewhere for 3 samples or more at a time (the crest of a smooth wave may meet one value in
    # every cycle)
    saturated: bool
    # standard error of the period (s), from the spread of the cycles' lengths
    error: float = np.nan

    @property
    def goes_on(self) -> bool:
        """Whether OP oscillates on."""
        return bool(np.isfinite(self.period))

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, the period with its 95 % interval; None where a number is missing."""
        return plain({
            "Kc": self.Kc, "period": self.period,
            "period_interval": interval(self.period, self.error),
            "amplitude": self.amplitude, "saturated": self.saturated,
        })  # fmt: skip


def measure(op: np.ndarray, Ts: float, Kc: float) -> Phase:
    """Return period and amplitude of an oscillating OP; the period is NaN when it is not
    sustained.
    """
    cycle = oscillation_of(op, Ts)
    amplitude = float(np.sqrt(2) * op.std())
    seen = cycle.sustained and amplitude > _SMALLEST
    at_ends = max(_share_at(op, float(op.min())), _share_at(op, float(op.max())))
    saturated = bool(amplitude > _SMALLEST and at_ends > 0.02)
    if not seen:
        return Phase(Kc, np.nan, amplitude, saturated)
    return Phase(Kc, cycle.period_s, amplitude, saturated, _period_error(op, Ts))


def _period_error(op: np.ndarray, Ts: float) -> float:
    """Return the standard error of the mean cycle (s): cycles lie between upward crossings of a
    band around the mean.
    """
    x = op - op.mean()
    band = _BAND * x.std()
    side = np.where(x > band, 1, np.where(x < -band, -1, 0))
    out = np.flatnonzero(side)
    ups = out[1:][np.diff(side[out]) > 0]
    lengths = np.diff(ups)
    if lengths.size < 2:
        return np.nan
    # two crossings are known to a sample
    return float(np.hypot(lengths.std(ddof=1) / np.sqrt(lengths.size), 1.0 / lengths.size) * Ts)


def ratio_error(before: Phase, after: Phase) -> float:
    """Return the relative standard error of the ratio of two periods; NaN where one is missing."""
    return float(np.hypot(before.error / before.period, after.error / after.period))


def interval(value: float, error: float) -> tuple[float, float] | None:
    """Return the ends of a 95 % interval; None where a number is missing."""
    if np.isfinite(value + error):
        return (value - _WIDE * error, value + _WIDE * error)
    return None


def _share_at(op: np.ndarray, value: float) -> float:
    """Return the share of the time that OP rests at a value."""
    length = holds(op)
    there = op[np.cumsum(length) - 1] == value
    return float(length[there & ((length >= 3) | (value in (0.0, 100.0)))].sum() / op.size)


def plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return numbers in JSON types, None where one is missing."""
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in values.items()}

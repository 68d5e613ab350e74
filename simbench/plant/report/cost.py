"""Measure what an oscillation costs: its share of the variance of PV, and the valve travel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord

_DAY = 86400.0
_HARMONICS, _BAND = (
    9,
    0.12,
)  # of the cycle that count, and the half width of each as a share of the fundamental
_DEAD = 0.1  # of OP's standard deviation, within which a change of direction is no reversal


@dataclass(frozen=True)
class Cost:
    """What the record shows of a loop's cost: the cycle's share of the variance of PV and of OP,
    the valve's travel and turns.

    `travel` (% a day, 100 = once from end to end) is None where the unit of OP is unknown,
    `automatic` without a recorded mode.
    """

    pv_share: float
    op_share: float
    travel: float | None
    reversals: float
    automatic: float | None
    saturated: float

    def sentence(self) -> str:
        """Return the cost in words."""
        parts = [
            f"the oscillation causes {self.pv_share:.0%} of the variance of PV and"
            f" {self.op_share:.0%} of that of OP"
        ]
        if self.travel is not None:
            parts.append(
                f"the valve travels {self.travel / 100:.0f} full strokes and reverses"
                f" {self.reversals:.0f} times a day"
            )
        if self.automatic is not None:
            parts.append(f"in automatic {self.automatic:.0%} of the time")
        if self.saturated > 0:
            parts.append(f"OP at a limit {self.saturated:.0%} of the time")
        return "; ".join(parts)


def cost_of(prepared: Prepared, record: LoopRecord) -> Cost:
    """Return what a record shows of its loop's cost; of MV where it was recorded, else of OP."""
    swing, days = prepared.oscillation, record.duration / _DAY
    shares = [
        cycle_share(x, swing.period_s / record.Ts) if swing.sustained else 0.0
        for x in (record.pv, record.op)
    ]
    percent = record.mv if record.mv is not None else record.op_percent
    moved = record.op if percent is None else percent
    travel = None if percent is None else float(np.abs(np.diff(percent)).sum()) / days
    at_limit = 0.0
    if record.op_percent is not None:
        at_limit = float(np.mean((record.op_percent <= 1e-6) | (record.op_percent >= 100.0 - 1e-6)))
    automatic = record.meta.get("automatic")
    return Cost(shares[0], shares[1], travel, reversals(moved) / days, automatic, at_limit)


def cycle_share(x: np.ndarray, period: float) -> float:
    """Return the share of a signal's variance at a period (samples) and its harmonics."""
    line = np.polyval(np.polyfit(np.arange(x.size), x, 1), np.arange(x.size))
    power = np.abs(np.fft.rfft((x - line) * np.hanning(x.size))) ** 2
    f = np.fft.rfftfreq(x.size)
    total = float(power[1:].sum())
    if total <= 0.0 or not np.isfinite(period):
        return 0.0
    near = np.abs(f - 1.0 / period) <= 0.3 / period
    peak = float(f[near][np.argmax(power[near])]) if near.any() else 1.0 / period
    inside = np.zeros(f.size, dtype=bool)
    for k in range(1, _HARMONICS + 1):
        inside |= np.abs(f - k * peak) <= max(_BAND * peak, 2.0 / x.size)
    inside[0] = False
    # what lies between the harmonics lies beneath them too
    beneath = float(np.median(power[1:][~inside[1:]])) if (~inside[1:]).any() else 0.0
    return float(np.clip((power[inside] - beneath).sum() / total, 0.0, 1.0))


def reversals(x: np.ndarray) -> int:
    """Return how often a signal turns by more than a tenth of its standard deviation."""
    band, last, way, count = _DEAD * float(np.std(x)), float(x[0]), 0, 0
    for value in x.tolist():
        step = value - last
        if abs(step) <= band:
            continue
        now = 1 if step > 0 else -1
        count += way == -now
        way, last = now, value
    return count

"""Compare the units of PV in record and loop file by their set points, and those of the integral
time by the controller's law.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.controller.law import Law
from simbench.scenarios.spec import Loop

_CLOSE = 2e-3  # of what the loop file's set point spans, within which both agree
_LEAST_SPAN = 0.1  # of its size, that a set point which hardly moves counts as spanning
_TIMES = 60.0  # seconds of a minute
_SAME = 0.03  # relative, within which two numbers of a controller are one


class _Unit(NamedTuple):
    """PV of the record = gain times PV of the loop file + offset, and both units in words."""

    gain: float
    offset: float
    record: str
    file: str


_KNOWN = (
    _Unit(1.8, 32.0, "deg F", "deg C"),
    _Unit(1.0 / 1.8, -32.0 / 1.8, "deg C", "deg F"),
    _Unit(1.0, 273.15, "K", "deg C"),
    _Unit(1.0, -273.15, "deg C", "K"),
    _Unit(100.0, 0.0, "%", "a share of 1"),
    _Unit(0.01, 0.0, "a share of 1", "%"),
    _Unit(1000.0, 0.0, "a unit a thousand times as small", "a larger one"),
    _Unit(0.001, 0.0, "a unit a thousand times as large", "a smaller one"),
    _Unit(14.5038, 0.0, "psi", "bar"),
    _Unit(1.0 / 14.5038, 0.0, "bar", "psi"),
    _Unit(60.0, 0.0, "a flow per hour", "one per minute"),
    _Unit(1.0 / 60.0, 0.0, "a flow per minute", "one per hour"),
)


def refuse_pv_units(record: LoopRecord, baseline: Loop, where: str) -> None:
    """Refuse a record whose set point is that of the loop file in another unit."""
    if record.sp is None:
        return
    stated = baseline.setpoint
    levels = np.array([stated.value] + [level for _, level in stated.steps], dtype=float)
    file = np.array([levels.min(), levels.max()])
    seen = np.array([record.sp.min(), record.sp.max()])
    if _ranges_agree(seen, file):
        return
    for unit in _KNOWN:
        if _ranges_agree(seen, unit.gain * file + unit.offset) and np.abs(file).max() > 0.0:
            raise RecordError(
                f"{where}: SP runs from {seen[0]:g} to {seen[1]:g}, in the loop file from"
                f" {file[0]:g} to {file[1]:g}: the record seems to be in {unit.record}, the loop"
                f" file in {unit.file}; write the loop file in the record's unit, with K ="
                f" {unit.gain * baseline.plant.K:.4g}, Kc ="
                f" {baseline.controller.Kc / unit.gain:.4g}, noise std ="
                f" {unit.gain * baseline.noise.std:.4g} and the record's set points"
            )


def _ranges_agree(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two ranges are the same, within a share of what they span."""
    span = max(float(np.ptp(other)), _LEAST_SPAN * float(np.abs(other).max()))
    return bool(np.abs(one - other).max() <= _CLOSE * span)


def refuse_time_units(law: Law, Kc: float, Ti: float | None, where: str) -> None:
    """Refuse a record whose controller is the loop file's but for an integral time in minutes."""
    if not law.known or not Ti or abs(law.Kc / Kc - 1.0) > _SAME:
        return
    for times, record, file in ((_TIMES, "s", "min"), (1.0 / _TIMES, "min", "s")):
        if abs(law.Ti / Ti / times - 1.0) <= _SAME:
            raise RecordError(
                f"{where}: its controller has Ti = {law.Ti:.4g} s, the loop file Ti = {Ti:g} s:"
                f" one seems to be in {record}, the other in {file}; write [controller] Ti ="
                f" {law.Ti:.4g}"
            )

"""Refuse comparisons that make no sense: signals in other units, or the baseline of another loop;
each refusal states its reason.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.judge import FEWEST
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import still
from simbench.gap.controller.law import Law

_LONGEST_RECORD = 50_000  # samples; beyond this the search takes hours
_SCALES = {0.16: (3.8, 20.5, "mA"), 0.01: (0.0, 1.0, "a share of 1")}  # of OP, in addition to %

SAME_TS = 0.01  # relative difference of two sampling periods that a time column may leave
_FASTEST = 10  # runs of a controller in a sample of the archive, at most


def refuse_other_pace(period: float, stated: float, where: str) -> None:
    """Refuse a record whose sampling period (s) is not the baseline's, nor a few times as long."""
    times = period / stated
    if not 1 <= round(times) <= _FASTEST or abs(times / round(times) - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {period:g} s by its time column, but the baseline says Ts ="
            f" {stated:g} s; they must agree within 1 %, or the record's be up to {_FASTEST} times"
            " as long, where the controller runs faster than the archive"
        )


def refuse_op_units(op: np.ndarray, law: Law, Kc: float, Ti: float | None, where: str) -> None:
    """Refuse OP on another scale: the law is the baseline's but for the scale's factor, and OP lies
    within the scale.
    """
    if not law.known or (Ti and abs(law.Ti / Ti - 1.0) > 0.05):
        return
    for factor, (low, high, unit) in _SCALES.items():
        if low <= op.min() and op.max() <= high and abs(law.Kc / Kc / factor - 1.0) < 0.03:
            raise RecordError(
                f"{where}: OP runs from {op.min():g} to {op.max():g} and answers PV with {factor:g}"
                f" times the baseline's Kc: it is in {unit}; give --op-span, the values that mean 0"
                " and 100 %"
            )


def refuse_unfit(record: LoopRecord, where: str) -> None:
    """Refuse a record that is too short, too long, or in which nothing moved."""
    if record.n < FEWEST:
        raise RecordError(f"{where}: {record.n} samples; a gap needs at least {FEWEST} to show")
    if record.n > _LONGEST_RECORD:
        raise RecordError(
            f"{where}: {record.n} samples; a gap is sought in at most {_LONGEST_RECORD}, cut some"
            " out with --window FROM TO"
        )
    for name, x in (("OP", record.op), ("PV", record.pv)):
        if still(x):
            raise RecordError(
                f"{where}: {name} is constant ({x[0]:g}); nothing moved, so nothing can be told"
            )

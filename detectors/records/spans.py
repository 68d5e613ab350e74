"""What OP and PV are 0 and 100 % of: a unit, a count or a current."""

from __future__ import annotations

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.dialects import entries

_SPANS = {
    "ma": ("mA", 4.0, 20.0),
    "m%": ("m%", 0.0, 1e5),
    "‰": ("‰", 0.0, 1e3),
}  # that a unit of OP fixes
_OTHER_SPANS = set(entries("v, volt, bar, mbar, kpa, psi, psig, mm, deg, rpm, hz, counts"))
_SHARE_OVER = 1.1  # what an output that is a share of 1 may read, 10 % over its range
_CURRENT = (3.5, 20.6)  # what an output of 4 to 20 mA may read
_LIKELY_SPANS = {
    "v": "1 5",
    "volt": "1 5",
    "bar": "0.2 1",
    "mbar": "200 1000",
    "kpa": "20 100",
    "psi": "3 15",
    "psig": "3 15",
}
_COUNTS = (
    (1023.0, "0 1023"),
    (4095.0, "0 4095"),
    (27648.0, "0 27648"),
    (32767.0, "0 32767"),
    (65535.0, "0 65535"),
)


def op_span(
    unit_of_op: str, known: object, op: np.ndarray, where: str, notes: list[str]
) -> tuple[float, float] | None:
    """Return the span that OP's unit fixes; % is 0..100 by itself, 4..20 mA is a standard, others
    must be given.
    """
    if known is not None:
        return None
    if unit_of_op in _SPANS:
        name, lo, hi = _SPANS[unit_of_op]
        notes.append(f"unit: OP is in {name}, {lo:g} to {hi:g} {name} taken as 0 to 100 %")
        return lo, hi
    if unit_of_op in _OTHER_SPANS:
        sentence = (
            f"{where}: OP is in {unit_of_op!r}; which values mean 0 and 100 % is needed (op_span)"
        )
        counts = next(
            (span for top, span in _COUNTS if unit_of_op == "counts" and np.nanmax(op) <= top),
            "0 100",
        )
        raise RecordError(sentence, f"--op-span {_LIKELY_SPANS.get(unit_of_op, counts)}")
    return None


def open_span(record: LoopRecord, where: str) -> list[str]:
    """Return the notes on an OP of unknown unit; a share of 1 is asked for, as %
    is 100 times as large.
    """
    if record.op_span is not None:
        return []
    lo = float(record.op.min())
    hi = float(record.op.max())
    runs = f"unit: OP runs from {lo:.4g} to {hi:.4g}"
    if record.op_share:
        sentence = (
            f"{where}: OP runs from {lo:.4g} to {hi:.4g}, a share of 1 or %; which values mean 0"
            " and 100 % is needed"
        )
        raise RecordError(sentence, "--op-span 0 1")
    if record.op_percent is None:
        # the range of the record is not that of the valve, and is never proposed
        counts = next((span for top, span in _COUNTS if hi <= top and lo >= 0), "")
        cure = f"if it is counts of a converter, add --op-span {counts}"
        unknown = "which values mean 0 and 100 % of travel is not known (--op-span LO HI states it)"
        return [f"{runs}, which is no %: S and J are in OP units; {cure if counts else unknown}"]
    other = "in mA, sizes are 6.25 times as large: add --op-span 4 20"
    if lo < hi <= _SHARE_OVER:
        other = "a share of 1, sizes are 100 times as large: add --op-span 0 1"
    elif not _CURRENT[0] <= lo < hi <= _CURRENT[1]:
        return []
    return [f"{runs}, taken as %; if it is {other}"]

"""Compare the clocks of PV and OP, and of the archive: a controller cannot answer what it has not
seen, and a scan that stands on record twice was one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.scenarios.plant import Controller

_MOST = 60  # samples by which PV may be stamped late
# of the variance of OP's changes, that the law may leave on the right clock, and of what it leaves
# on the record's
_LEFT = 0.2
_SHARE = 0.3
_SHIFTED = 0.5  # of a record, that must be left
_SLIPS = 0.02  # share of scans that stand twice, above which the archive repeats values by nature


def without_repeats(record: LoopRecord) -> tuple[LoopRecord, int]:
    """Return a record without the scans that its archive took twice, as OP and PV repeat together
    and hardly ever alone, and how many these are.
    """
    op, pv = (np.append(False, np.diff(x) == 0.0) for x in (record.op, record.pv))
    twice = op & pv
    count = int(twice.sum())
    if not 0 < count <= _SLIPS * record.n or int(op.sum() + pv.sum()) > 3 * count:
        return record, 0
    manual = record.meta.get("manual")
    if manual is not None:
        record = replace(record, meta={**record.meta, "manual": np.asarray(manual)[~twice]})
    return record.with_signals(lambda x: x[~twice], Ts=record.Ts), count


def pv_late(record: LoopRecord, op: np.ndarray, controller: Controller) -> int:
    """Return by how many samples PV is stamped late against OP (%): OP answers it before it is on
    record, by the stated law; 0 where it does not, or the controller is neither P nor PI.
    """
    if controller.type not in ("P", "PI") or record.sp is None:
        return 0
    most = min(_MOST, int(_SHIFTED * record.n))
    moved = float(np.var(np.diff(op))) or 1.0
    left = np.array([_variance_left(record, op, controller, late) for late in range(most)]) / moved
    late = int(np.argmin(left))
    return late if late and left[late] < min(_LEFT, _SHARE * left[0]) else 0


def _variance_left(record: LoopRecord, op: np.ndarray, c: Controller, late: int) -> float:
    """Return the variance of what the law leaves of OP's changes, were PV stamped so many samples
    late.
    """
    n = op.size - late
    error = np.asarray(record.sp)[:n] - np.asarray(record.pv)[late:]
    change = np.diff(error) + (0.0 if c.Ti is None else record.Ts / c.Ti * error[1:])
    return float(np.var(np.diff(op[:n]) - c.sign * c.Kc * change))


def on_one_clock(record: LoopRecord, late: int) -> LoopRecord:
    """Return a record with PV moved back by so many samples, which are missing at its end."""
    n = record.n - late
    return replace(record.window(0, n), pv=np.asarray(record.pv)[late:])

"""Recognise the slave of a cascade whose set point is not on record: PV follows something slow, and
OP drives it there.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.thresholds import SLAVE_TOGETHER

# Slow is what is left of a moving mean over two periods, or a thirtieth of a record that does not
# oscillate. Where integral action holds a constant set point the mean of PV moves against the load,
# and OP otherwise (correlations of .6 at most on the records of `tests/data/published`); of the
# cooling water of the Tennessee Eastman process OP and PV go together by .90 to .98.
_PERIODS = 2.0
_PART = 30.0
_APART = 0.6  # of what is quicker: under P control OP goes with PV at every pace
_SHARE = 0.05  # of PV's standard deviation, that is slow


def slave_note(record: LoopRecord) -> str:
    """Return that a record is likely the slave's of a cascade, "" where nothing shows it."""
    if record.sp is not None:
        return ""
    swing = find_oscillation(record.op, record.pv, record.Ts)
    width = _PERIODS * swing.period_s / record.Ts if swing.sustained else record.n / _PART
    width = int(np.clip(width, 5, max(record.n / 6, 5)))
    if record.n < 3 * width:
        return ""
    signals = np.array([record.op - record.op.mean(), record.pv - record.pv.mean()])
    mean = np.ones(width) / width
    slow = np.array([np.convolve(x, mean, "valid") for x in signals])
    quick = signals[:, width // 2 :][:, : slow.shape[1]] - slow
    sizes = signals.std(axis=1)
    if min(*sizes, *slow.std(axis=1), *quick.std(axis=1)) <= 0.0:
        return ""
    together, apart = (float(np.corrcoef(x)[0, 1]) for x in (slow, quick))
    alike = apart * np.sign(together) > _APART
    if abs(together) < SLAVE_TOGETHER or alike or slow[1].std() < _SHARE * sizes[1]:
        return ""
    return (
        "SP is not on record, and PV goes slowly where OP drives it: likely the slave of a cascade;"
        " with its set point on record more can be told"
    )

"""Apply the archive of a record (averages, rounding, delayed OP) to a simulated record, so that
both can be compared.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.signal.lattice import written
from simbench.gap.controller.recovered_pv import mean_like
from simbench.gap.situation import Situation


def as_archived(
    situation: Situation, op: np.ndarray, pv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return OP and PV of a simulated loop after the changes that the archive made to the recorded
    ones.
    """
    late = situation.law.late
    if late:
        op = np.append(np.repeat(op[0], late), op[:-late])
    if situation.law.averaged and situation.law.recovered_pv is not None:
        pv = mean_like(situation.record.pv, situation.law.recovered_pv, pv)
    op, pv = (
        unit * np.round(x / unit) if unit > 0.0 else x
        for x, unit in zip((op, pv), _digits_of(situation))
    )
    return op, pv


@lru_cache(maxsize=4)
def _digits_of(s: Situation) -> tuple[float, float]:
    """Return the steps in which OP and PV are written, computed once per record because it is
    simulated many times.
    """
    return written(s.op, s.record.pv).digits, written(s.record.pv, s.op).digits

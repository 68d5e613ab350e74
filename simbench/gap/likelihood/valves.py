"""Find the valves that explain PV under a load of any spectrum, by regression."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from simbench.detectors.signal.fits.regression import regression
from simbench.detectors.signal.oscillation import find_oscillation

_CYCLES = 8.0  # of which a record without a rhythm is taken to consist


class Regressed(NamedTuple):
    """What a valve with friction explains of PV in place of OP and beside it.

    `gain` (nats) of both together; `valves` (p, 3) the best of both, as in `Regression`; `cycles`
    of the record, and its `pace`, the samples per period of an oscillation, 0 where it has none.
    """

    gain: float
    valves: np.ndarray
    cycles: float
    pace: float


def friction_regressed(op: np.ndarray, pv: np.ndarray) -> Regressed:
    """Return what a valve with friction explains of PV (n,), without a model of the loop."""
    return _regress_valves(np.asarray(op, float).tobytes(), np.asarray(pv, float).tobytes())


@lru_cache(maxsize=2)  # both kinds of plant, and the conclusion, ask about the same record
def _regress_valves(op_bytes: bytes, pv_bytes: bytes) -> Regressed:
    op, pv = (np.frombuffer(x) for x in (op_bytes, pv_bytes))
    swing = find_oscillation(op, pv, 1.0)
    if np.isfinite(swing.period_s):
        period = swing.period_s
    else:
        period = op.size / _CYCLES
    period = float(np.clip(period, 4, op.size / 2))
    found = [regression(op, pv, period, beside) for beside in (False, True)]
    valves = np.vstack([f.valves for f in found])
    pace = swing.period_s if swing.sustained else 0.0
    return Regressed(sum(f.gain for f in found), valves, op.size / period, pace)

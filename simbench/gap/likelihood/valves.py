"""Find the valves that explain PV under a load of any spectrum, by regression."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from simbench.detectors.signal.fits.regression import known_valve, regression
from simbench.detectors.signal.oscillation import find_oscillation

_CYCLES = 8.0  # of which a record without a rhythm is taken to consist


class Regressed(NamedTuple):
    """What a valve with friction explains of PV in place of OP and beside it.

    `gain` (nats) of both together; `valves` (p, 3) the best of both, as in `Regression`; `cycles`
    of the record.
    """

    gain: float
    valves: np.ndarray
    cycles: float


def friction_regressed(op: np.ndarray, pv: np.ndarray) -> Regressed:
    """Return what a valve with friction explains of PV (n,), without a model of the loop."""
    return _of(np.asarray(op, float).tobytes(), np.asarray(pv, float).tobytes())


def valve_regressed(op: np.ndarray, pv: np.ndarray, S: float, J: float) -> tuple[float, float]:
    """Return the nats that one valve explains of PV (n,) in place of OP and beside it together, and
    the cycles of the record.
    """
    period, valve = _period(op, pv), np.array([S, J, 0.0])
    gain = sum(known_valve(op, pv, period, valve, beside) for beside in (False, True))
    return gain, op.size / period


def _period(op: np.ndarray, pv: np.ndarray) -> float:
    """Return the period (samples) of a record, or that which a record without a rhythm is taken to
    have.
    """
    period = find_oscillation(op, pv, 1.0).period_s
    return float(np.clip(period if np.isfinite(period) else op.size / _CYCLES, 4, op.size / 2))


@lru_cache(maxsize=2)  # both kinds of plant, and the conclusion, ask about the same record
def _of(op_bytes: bytes, pv_bytes: bytes) -> Regressed:
    op, pv = (np.frombuffer(x) for x in (op_bytes, pv_bytes))
    period = _period(op, pv)
    found = [regression(op, pv, period, beside) for beside in (False, True)]
    valves = np.vstack([f.valves for f in found])
    return Regressed(sum(f.gain for f in found), valves, op.size / period)

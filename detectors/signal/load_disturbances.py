"""Hagglund's test for oscillation: count load disturbances in the control error; an oscillating
loop has more of them than a quiet one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.signal.oscillation import (
    MOST_LOADS,
    Oscillation,
    find_oscillation,
    iae_loads,
)

_SUPERVISION = 50.0  # integral times of the controller
_SMALLEST = 0.01  # amplitude that matters, as a share of PV's span


def oscillation_by_loads(
    op: np.ndarray, pv: np.ndarray, e: np.ndarray, Ts: float, span: float | None = None
) -> Oscillation:
    """Find the oscillation of a loop by Hagglund's load disturbances: the front end of those who
    look at the error alone.

    Source: as `iae_loads`, with its smallest amplitude (1 % of span) and supervision time (50
    integral times). The integral time is read off OP and e, as below; where they show none, the
    oscillation's period is used. That a period is required is an addition of this package: many
    detectors need it, and in a large noise every few samples are a load. Not for a P controller or
    a slow oscillation, of more than about ten integral times: too few loads are in memory at once.
    """
    oscillation = find_oscillation(op, pv, Ts)
    period = integral_time(op, e, Ts) or oscillation.period_s
    span = float(np.ptp(pv)) if span is None else span
    if not (np.isfinite(period) and span > 0.0):
        return replace(oscillation, sustained=False, loads=0.0)
    loads = iae_loads(e, Ts, _SMALLEST * span, period, np.exp(-Ts / (_SUPERVISION * period)))
    return replace(
        oscillation,
        sustained=loads > MOST_LOADS and bool(np.isfinite(oscillation.period_s)),
        loads=loads,
    )


def integral_time(op: np.ndarray, e: np.ndarray, Ts: float) -> float | None:
    """Return Ti (s) of the PI controller that moved OP by e, shapes (n,); None when no such
    controller did.

    Least squares of OP's steps over those of e and e itself: dOP = Kc (de + Ts/Ti e), either sign
    of Kc.
    """
    steps = np.column_stack([np.diff(e), e[1:]])
    (gain, rate), *_ = np.linalg.lstsq(steps, np.diff(op), rcond=None)
    left = np.diff(op) - steps @ (gain, rate)
    if gain * rate <= 0.0 or left @ left > 0.5 * np.diff(op) @ np.diff(op):
        return None
    return float(Ts * gain / rate)

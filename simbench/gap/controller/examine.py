"""Choose the controller law of a loop (PI or PID) and test whether it computes the recorded OP from
the recorded error.
"""

from __future__ import annotations

import numpy as np

from detectors.signal.filters import lfilter
from detectors.signal.lattice import written
from scenarios.spec import Controller, Loop
from simbench.gap.controller.pi_law import DIGITS, Law, best_aligned, examine_law
from simbench.gap.controller.regression import EXACT
from simbench.gap.sensor.samples import exception_band
from simbench.loop.controller import pid_numbers


def examine_controller(
    op: np.ndarray,
    pv: np.ndarray,
    sp: np.ndarray | None,
    Ts: float,
    loop: Loop,
    trusted: bool = True,
    noise: float = 0.0,
) -> Law:
    """Judge a loop's controller from SP, PV and OP, by PI's regression or a PID's settings."""
    c = loop.controller
    if c.type == "PID":
        return best_aligned(lambda pv, sp: _examine_pid(op, pv, sp, Ts, c, loop.pv0), pv, sp)
    return examine_law(op, pv, sp, Ts, c.sign * c.Kc, c.Ti, trusted, noise)


def _examine_pid(
    op: np.ndarray,
    pv: np.ndarray,
    sp: np.ndarray | None,
    Ts: float,
    settings: Controller,
    pv0: float,
) -> Law:
    """Judge a PID under one alignment of the signals: positional and velocity form move OP alike
    between its limits, and an archive that repeats values by exception hides what it left out.
    """
    Ti = settings.Ti or np.inf
    p = pid_numbers(settings, settings.sign * settings.Kc, Ti, Ts, pv0, -np.inf, np.inf)
    sp = np.full(pv.size, pv.mean()) if sp is None else sp
    r, e = sp - p.pv0, sp - pv
    seen = (pv, np.append(op[0], op[:-1]), sp)[int(p.on)]
    gain = np.interp(seen, p.at, p.factor)
    rate = np.append(0.0, np.diff(e - (1.0 - p.c) * r))
    moves = np.diff(
        gain * p.Kc * (e - (1.0 - p.b) * r)
        + lfilter([1.0], [1.0, -p.fade], gain * p.Kc * p.kd * rate)
    )
    du = np.diff(op)
    free = du != 0.0
    if not free.any():
        return Law(1.0, p.Kc, Ti, reason="OP stands nearly all the time")
    size = float(np.median(np.abs(du[free])))
    residual = float(np.median(np.abs(du - moves - (gain * p.Ki * e)[1:])[free])) / size
    per_pv, op_is, pv_is = abs(p.Kc) * (1.0 + p.kd), written(op, pv), written(pv, op)
    digits = DIGITS * max(op_is.unit, per_pv * pv_is.unit) / size
    hidden = 2.0 * (
        exception_band(op, max(op_is.unit, op_is.step))
        + per_pv * exception_band(pv, max(pv_is.unit, pv_is.step))
    )
    known = residual < max(EXACT, min(digits, 0.5), hidden / size)
    why = "" if known else "the PID's settings do not turn the recorded PV into the recorded OP"
    return Law(residual, p.Kc, Ti, reason=why, hidden=hidden)

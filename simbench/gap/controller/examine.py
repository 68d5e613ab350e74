"""Test whether the controller that a loop file states computes the recorded OP from the recorded
error.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.controller.law import Law
from simbench.gap.controller.pi_law import examine_law
from simbench.gap.controller.pid_law import Stated
from simbench.scenarios.spec import Loop


def stated_controller(loop: Loop, Ts: float) -> Stated:
    """Return the controller of a loop file."""
    c = loop.controller
    return Stated(c.sign * c.Kc, c.Ti, Ts, c if c.type == "PID" else None, loop.pv0)


def examine_controller(
    op: np.ndarray,
    pv: np.ndarray,
    sp: np.ndarray | None,
    Ts: float,
    loop: Loop,
    trusted: bool = True,
    noise: float = 0.0,
) -> Law:
    """Judge a loop's controller from SP, PV and OP."""
    return examine_law(op, pv, sp, stated_controller(loop, Ts), trusted, noise)

"""Choose the controller law of a loop (PI or PID) and test whether it computes the recorded OP from
the recorded error.
"""

from __future__ import annotations

import numpy as np

from scenarios.spec import Loop
from simbench.gap.controller.pi_law import Law, examine_law
from simbench.gap.controller.pid_law import examine_pid


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
        return examine_pid(op, pv, sp, Ts, c, loop.pv0)
    return examine_law(op, pv, sp, Ts, c.sign * c.Kc, c.Ti, trusted, noise)

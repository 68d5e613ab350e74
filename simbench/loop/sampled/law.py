"""Controller stated by num and den in powers of z, from the error to OP (type "tf").

When to choose it: a law that is known sample by sample, such as one that was identified.
When not: P, PI or PID, whose numbers a reader knows, and theory too.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from simbench.scenarios.plant import Controller

SampledLaw = namedtuple("SampledLaw", "num den sign Kc op0 pv0 lo hi")


def numbers(controller: Controller) -> SampledLaw:
    """Return the numbers of `step`; `den` without the 1 that it begins with."""
    num = np.array(controller.num)
    den = np.array(controller.den)[1:]
    return SampledLaw(num, den, controller.sign, 1.0, 50.0, 0.0, 0.0, 100.0)


def start(p):
    """Return the state (OP, past deviations of OP, past errors, the latest first) at rest."""
    return p.op0, np.zeros(p.den.size), np.zeros(p.num.size)


def step(e, sp, state, p):
    """One sample: error and SP in, state out, OP within lo..hi; its arrays change in place.

    What goes into the next sample is OP as it was limited, and moved by others: so a limit winds
    nothing up (Astrom and Hagglund 2006, Advanced PID Control, section 3.5).
    """
    # Past outputs and errors move on by one
    past = state[1]
    errors = state[2]
    for i in range(past.size - 1, 0, -1):
        past[i] = past[i - 1]
    past[0] = state[0] - p.op0
    for i in range(errors.size - 1, 0, -1):
        errors[i] = errors[i - 1]
    errors[0] = p.sign * p.Kc * e

    # The difference equation
    u = p.op0
    for i in range(errors.size):
        u += p.num[i] * errors[i]
    for i in range(past.size):
        u -= p.den[i] * past[i]
    return min(max(u, p.lo), p.hi), past, errors

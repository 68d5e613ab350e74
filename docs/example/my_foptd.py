"""First order with dead time, written as a plug-in: its numbers are those of type "foptd", to the
last bit.

Try it: `[plant] type = "my_foptd"` and `--plant-plugin my_foptd.py`.
"""

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "definition: K e^(-Td s)/(T s + 1)"
INTEGRATING = False
PARAMETERS = {
    "K": Number("PV units per %", says="gain"),
    "T": Number("s", low=0.0, positive=True, says="time constant"),
}


def linear(p):
    """Return numerator and denominator without the dead time: with it, theory knows the plant."""
    return [p.K], [p.T, 1.0]


def start(p):
    """Return the state at rest: the deviation of PV, then what each sample needs again."""
    A, B = -1.0 / p.T, p.K / p.T
    late = p.Td - np.floor(p.Td / p.Ts + 1e-9) * p.Ts
    old = late if late > 1e-9 * p.Ts else 0.0

    def rise(h):
        return B * (np.expm1(A * h) / A)

    return 0.0, np.exp(A * p.Ts), np.exp(A * (p.Ts - old)) * rise(old), rise(p.Ts - old)


def step(w_old, w_new, state, p):
    """One sample: MV's deviations (%), `w_old` for the part of a sample that the dead time leaves,
    then `w_new`.
    """
    x, a, b_old, b_new = state
    return a * x + (b_old * w_old + b_new * w_new), a, b_old, b_new

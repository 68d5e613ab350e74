"""Plant stated by num and den in powers of z: PV's samples from their past and that of MV (type
"tf" with `dt`).

When to choose it: what was identified from samples, of any order up to 20.
When not: a plant that is known in s, whose dead time need not be whole samples and which theory
knows.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from simbench.scenarios.plant import Plant

# Ljung (1999), System Identification, section 4.2: A(z) y(t) = B(z) u(t)
SampledTransfer = namedtuple("SampledTransfer", "num den Td op0 pv0")


def numbers(plant: Plant) -> SampledTransfer:
    """Return the numbers of `step`; `num` and `den` without the 1 that den begins with."""
    return SampledTransfer(np.array(plant.num), np.array(plant.den)[1:], plant.Td, 0.0, 0.0)


def start(p):
    """Return the state (deviation of PV, its past and that of MV, the latest first) at rest."""
    return 0.0, np.zeros(p.den.size), np.zeros(p.num.size)


def step(w_old, w_new, state, p):
    """One sample: the inflow's deviation `w_new` (%) and state in, state out; its arrays change in
    place.
    """
    # Past movements move on by one
    past = state[1]
    moved = state[2]
    for i in range(moved.size - 1, 0, -1):
        moved[i] = moved[i - 1]
    moved[0] = w_new

    # The difference equation
    y = 0.0
    for i in range(moved.size):
        y += p.num[i] * moved[i]
    for i in range(past.size):
        y -= p.den[i] * past[i]

    # Past outputs as well
    for i in range(past.size - 1, 0, -1):
        past[i] = past[i - 1]
    past[0] = y
    return y, past, moved

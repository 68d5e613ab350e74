"""Spring-and-diaphragm valve whose friction grows again as it slows down (Stribeck): it stops early
and jumps on.

When to choose it: slow OP, as closed loops with weak integral action make it. Below about vs (0.25
% of travel per second) steady sliding is unstable, and a slow ramp moves the valve in repeated
jumps, as He's map does, where `coulomb` jumps once and slides.
When not: OP moves by several vs most of the time, or is held so long that the valve stops in every
sample; there it is `coulomb` at several times the cost.

Moving friction Fc + (Fs - Fc) exp(-(x'/vs)^2) + Fv x'. Exact between events while the valve is
fast, adaptive steps below 6 vs. S and J may be given instead of Fs and Fc.
"""

from simbench.loop.parameters import Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, SUBSTEP, complete_actuator
from simbench.loop.physical.substeps import slide_in_substeps
from simbench.loop.physical.tail import slide_stribeck

SOURCE = (
    "Stribeck curve in the exponential form of Armstrong-Helouvry (1991); actuator: "
    + actuator.SOURCE
)
FRICTION = True
PARAMETERS = {
    **ACTUATOR,
    "vs": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=0.000254,
        says="Stribeck speed (published: 0.01 in/s)",
    ),
    "dv": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=1e-9,
        says="speed below which the valve counts as standing",
    ),
    "substep": SUBSTEP,
}

complete = complete_actuator
mapped_SJ = actuator.mapped_SJ


def start(u0, p):
    """Return the state (v, rate, h) at rest in mid-band under OP `u0` (%); rate in %/s, h is a step
    size in s.
    """
    return min(max(u0, 0.0), 100.0), 0.0, 1e-6


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rate, h) out, v = MV (%) at the sample's end."""
    v, rate, h = state
    x = min(max(u, 0.0), 100.0)
    fs = 0.5 * (p.S + p.J)
    fd = 0.5 * (p.S - p.J)
    vs = 100.0 * p.vs / p.stroke
    a = 0.5 * p.Fv / p.m
    w2 = p.k / p.m
    rest = 100.0 * p.dv / p.stroke
    if p.substep > 0.0:
        v, rate = slide_in_substeps(x, v, rate, fs, fd, vs, a, w2, rest, p.Ts, p.substep)
        return v, rate, h
    return slide_stribeck(x, v, rate, h, fs, fd, vs, a, w2, rest, p.Ts)

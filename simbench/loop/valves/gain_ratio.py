"""Closing characteristic, a stage: the gain from OP to flow changes evenly, in the logarithm, along
the travel; ends fixed.

When to choose it: the simplest curve that closes at 0 and opens fully at 100, with one number for
how bent it is; equal-percentage like for R > 1, quick-opening like for R < 1, straight at R = 1.
When not: a real valve's data sheet, or a line that takes part of the pressure (`characteristic`
knows leakage and authority).
"""

from math import expm1, log

from simbench.loop.parameters import Number

SOURCE = (
    "IEC 60534-2-4, inherent equal percentage, shifted to close: MV = 100 (R^(OP/100) - 1)/(R - 1)"
)
FRICTION = False
PARAMETERS = {
    "R": Number("", low=0.01, high=100.0, says="local gain at OP = 100 over that at OP = 0")
}


def start(u0, p):
    """Return the state (MV,) under OP `u0` (%)."""
    return step(u0, (0.0,), p)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (MV,) out, MV in % of full flow."""
    x = 0.01 * min(max(u, 0.0), 100.0)
    bend = log(p.R)
    if abs(bend) < 1e-9:
        return (100.0 * x,)
    return (100.0 * expm1(bend * x) / expm1(bend),)

"""Ideal valve: the position is the controller output, limited to its travel.

When to choose it: the healthy twin of any sticky loop, and wherever the valve is not the question.
When not: as the only healthy valve of a study; a packed valve has at least some dead-band
(`deadband`).
"""

SOURCE = "definition: MV = OP within 0..100 % of travel"
FRICTION = False
PARAMETERS = {}


def start(u0, p):
    """Return the state (v,) at rest under OP `u0` (%)."""
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v,) out, v = MV (%)."""
    return (min(max(u, 0.0), 100.0),)


def mapped_SJ(p):
    """Return (S, J) in % of travel: none."""
    return 0.0, 0.0

"""Stenman's one-parameter model: the valve waits until OP is more than d away, then jumps all the
way to OP.

When to choose it: the simplest picture of a sticking valve, or to compare with segmentation methods
built on it.
When not: undershoot, dead-band or a smooth moving phase matter. It sticks again at every sample, so
its staircase depends on the sampling period; that of `choudhury` with S = J = d, the same band,
does not while OP keeps moving.
"""

from simbench.loop.parameters import Number

SOURCE = (
    "Stenman, Gustafsson and Forsman (2003), Int. J. Adaptive Control and Signal Processing 17,"
    " 625-634"
)
FRICTION = True
PARAMETERS = {
    "d": Number("% of travel", low=0.0, high=100.0, says="distance at which the valve jumps")
}


def start(u0, p):
    """Return the state (v,) at rest under OP `u0` (%)."""
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v,) out, v = MV (%)."""
    x = min(max(u, 0.0), 100.0)
    if abs(x - state[0]) > p.d:
        return (x,)
    return state


def mapped_SJ(p):
    """Return (S, J) in % of travel: the stick band is the whole band."""
    return p.d, p.d


def for_SJ(S, J, period):
    """Return the parameters that stick for S; J cannot be chosen."""
    return {"d": S}

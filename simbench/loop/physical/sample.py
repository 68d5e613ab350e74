"""One sample of an actuator with dry friction: exact by default, in fixed sub-steps when asked."""

from simbench.loop.physical.motion import slide
from simbench.loop.physical.substeps import slide_in_substeps


def move(u, state, S, J, p):
    """Return the state (v, rate) after one sample p.Ts under OP `u` (%), with the friction of a
    band S, J (%).

    `p` holds Fv, m, k, stroke, dv and substep as in actuator.py; v in %, rate in %/s.
    """
    x = min(max(u, 0.0), 100.0)
    fs = 0.5 * (S + J)
    fd = 0.5 * (S - J)
    a = 0.5 * p.Fv / p.m
    w2 = p.k / p.m
    rest = 100.0 * p.dv / p.stroke
    if p.substep > 0.0:
        return slide_in_substeps(x, state[0], state[1], fs, fd, 0.0, a, w2, rest, p.Ts, p.substep)
    return slide(x, state[0], state[1], fs, fd, a, w2, rest, p.Ts)

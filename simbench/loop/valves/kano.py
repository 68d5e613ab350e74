"""Kano's stiction model: the same (S, J) valve as Choudhury's, told by where OP stood when the
valve stopped.

When to choose it: to compare with work that uses Kano's form, or as an independent statement of
`choudhury`: the two give the same positions, bit for bit, as long as the position of an
overshooting valve (J > S) is not cut off at an end of travel.
When not: everywhere `choudhury` is not for (noisy OP, creeping OP).
"""

from simbench.loop.parameters import Number

SOURCE = (
    "Kano, Maruta, Kugemoto and Shimizu (2004), Practical model and detection algorithm for valve"
    " stiction, DYCOPS"
)
FRICTION = True
PARAMETERS = {
    "S": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band"),
    "J": Number("% of travel", low=0.0, high=100.0, says="slip jump"),
}


def start(u0, p):
    """Return the state (v, rest, d, stuck, u_prev, du_prev) at rest in mid-band under OP `u0`
    (%).
    """
    x = min(max(u0, 0.0), 100.0)
    return x, x, 1.0, 1.0, x, 0.0


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rest, d, stuck, u_prev, du_prev) out, v = MV (%).

    rest is where the valve stopped, before any end of travel; d the last direction of motion (+1
    opening).
    """
    v, rest, d, stuck, u_prev, du_prev = state
    x = min(max(u, 0.0), 100.0)
    du = x - u_prev
    if stuck == 0.0 and du * du_prev <= 0.0:
        rest = u_prev - d * 0.5 * (p.S - p.J)
        stuck = 1.0
    if stuck == 1.0:
        # -d (u - u_s) > S and d (u - u_s) > J with u_s = rest + d (S - J)/2 put in: ties then round
        # as in `choudhury`
        if -d * (x - rest) > 0.5 * (p.S + p.J):
            d = -d
            stuck = 0.0
        elif d * (x - rest) > 0.5 * (p.S + p.J):
            stuck = 0.0
    if stuck == 0.0:
        v = min(max(x - d * 0.5 * (p.S - p.J), 0.0), 100.0)
    return v, rest, d, stuck, x, du


def mapped_SJ(p):
    """Return (S, J) in % of travel."""
    return p.S, p.J

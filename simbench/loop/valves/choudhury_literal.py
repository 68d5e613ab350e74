"""Choudhury's flow chart read to the letter: every change of sign of OP's slope starts a new band.

When to choose it: to reproduce published simulations that were run with the flow chart as printed.
When not: anywhere else. Each noise reversal of OP puts the start of the band where OP is, so a
valve under noisy OP may never move however far OP drifts; and after a hold the smaller threshold J
also lets OP turn back, which friction does not. `choudhury` mends both.

The chart has no word for a valve at rest in mid-band: here it starts with the band at OP, threshold
S on both sides.
"""

from simbench.loop.parameters import Number

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, flow chart of"
    " the data-driven model"
)
FRICTION = True
PARAMETERS = {
    "S": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band"),
    "J": Number("% of travel", low=0.0, high=100.0, says="slip jump"),
}


def start(u0, p):
    """Return the state (v, x_ss, held, slope, u_prev) at rest under OP `u0` (%)."""
    x = min(max(u0, 0.0), 100.0)
    return x, x, 0.0, 0.0, x


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, x_ss, held, slope, u_prev) out, v = MV (%).

    x_ss is OP where the band began, `held` is 1 when it began with a pause of OP, `slope` the sign
    of OP's change.
    """
    # OP within travel, and which way it goes
    v, x_ss, held, slope_old, u_prev = state
    x = min(max(u, 0.0), 100.0)
    slope = 0.0
    if x > u_prev:
        slope = 1.0
    elif x < u_prev:
        slope = -1.0

    # OP rests or turns: the valve sticks there
    if slope == 0.0 and slope_old != 0.0:
        x_ss = u_prev
        held = 1.0
    elif slope * slope_old < 0.0:
        x_ss = u_prev
        held = 0.0

    # It moves on once OP has gone past the band
    threshold = p.J if held == 1.0 else p.S
    if abs(x - x_ss) > threshold:
        v = min(max(x - slope * 0.5 * (p.S - p.J), 0.0), 100.0)
    return v, x_ss, held, slope, x


def mapped_SJ(p):
    """Return (S, J) in % of travel."""
    return p.S, p.J

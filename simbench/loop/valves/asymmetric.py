"""Stiction that differs by direction: its own S and J for opening and for closing.

When to choose it: packing or plug load that helps one direction (flow to open, flow to close), or
an asymmetric cycle, which second-order spectra see and a symmetric one hides from them.
When not: nothing tells the directions apart in the record; four numbers then fit what two would
(`choudhury`).

S_up and J_up give the residuals of opening: break-away at OP - MV > (S_up + J_up)/2, motion at
(S_up - J_up)/2; S_down and J_down those of closing. OP must cross (S_up - J_up)/2 + (S_down +
J_down)/2 between an opening and a closing motion: S when both sides are equal, and then the valve
is `choudhury`.
"""

from simbench.loop.parameters import Number

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, with a"
    " friction per direction"
)
FRICTION = True
PARAMETERS = {
    "S_up": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band, opening"),
    "J_up": Number("% of travel", low=0.0, high=100.0, says="slip jump, opening"),
    "S_down": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band, closing"),
    "J_down": Number("% of travel", low=0.0, high=100.0, says="slip jump, closing"),
}


def start(u0, p):
    """Return the state (v, d, moving, u_prev) at rest under OP `u0` (%)."""
    x = min(max(u0, 0.0), 100.0)
    return x, 0.0, 0.0, x


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, d, moving, u_prev) out, v = MV (%)."""
    # OP within travel
    v, d, moving, u_prev = state
    x = min(max(u, 0.0), 100.0)

    # A valve that rests breaks away in either direction by its own band
    if moving == 0.0 or (x - u_prev) * d <= 0.0:
        moving = 0.0
        if x - v > 0.5 * (p.S_up + p.J_up):
            d = 1.0
            moving = 1.0
        elif x - v < -0.5 * (p.S_down + p.J_down):
            d = -1.0
            moving = 1.0

    # A moving valve follows at its own distance
    if moving == 1.0:
        if d > 0.0:
            fd = 0.5 * (p.S_up - p.J_up)
        else:
            fd = 0.5 * (p.S_down - p.J_down)
        v = min(max(x - d * fd, 0.0), 100.0)
    return v, d, moving, x


def mapped_SJ(p):
    """Return (S, J) in % of travel: the means of both directions, exact for the width of the
    cycle.
    """
    return 0.5 * (p.S_up + p.S_down), 0.5 * (p.J_up + p.J_down)


def for_SJ(S, J, period):
    """Return the parameters with these means, opening with 1.3 and closing with 0.7 of them."""
    return {"S_up": 1.3 * S, "J_up": 1.3 * J, "S_down": 0.7 * S, "J_down": 0.7 * J}

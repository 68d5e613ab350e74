"""PI whose gain grows with the error: slow near the set point, quick far from it.

When to choose it: levels that may float, whose outflow must stay calm.
When not: flow and pressure; near the set point there is hardly a gain, and a sticky valve cycles
slowly and widely.
"""

from simbench.loop.parameters import Number

SOURCE = (
    "Shinskey (1996), Process Control Systems, 4th ed., nonlinear controllers: error-squared PI"
)
INTEGRAL = True
PARAMETERS = {
    "Kc": Number("% per PV unit", low=0.0, positive=True, says="gain at an error of `width`"),
    "Ti": Number("s", low=0.0, positive=True, says="integral time"),
    "width": Number("PV units", low=0.0, positive=True, says="error at which the gain is Kc"),
}


def start(p):
    """Return the state (OP, previous error) at rest."""
    return p.op0, 0.0


def step(e, sp, state, p):
    """One sample: error `e` = SP - PV and SP in, state (OP, error) out; OP within lo..hi."""
    gain = p.sign * p.Kc * min(abs(e) / p.width, 4.0)
    u = state[0] + gain * (e - state[1] + p.Ts / p.Ti * e)
    return min(max(u, p.lo), p.hi), e

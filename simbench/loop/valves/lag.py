"""Actuator lag with a rate limit, a stage: the position follows its input like a first-order lag of
limited speed.

When to choose it: a pneumatic actuator or positioner that is slow against the process (T from
filling and venting, the rate from its air supply), in front of or behind any friction model.
When not: in front of the physical models as a stand-in for their own dynamics; those have mass and
damping already.

Exact under an input held over the sample: at full speed until the input is within rate T,
exponential from there. T = 0 is a pure rate limit; without a rate the lag is linear. The state
after a sample is the position at its end.
"""

from math import exp, inf

from simbench.loop.parameters import Number

SOURCE = "definition: v' = (u - v)/T, |v'| <= rate"
FRICTION = False
PARAMETERS = {
    "T": Number("s", low=0.0, default=0.0, says="time constant"),
    "rate": Number(
        "%/s", low=0.0, positive=True, default=inf, says="largest speed; unlimited when absent"
    ),
}


def start(u0, p):
    """Return the state (v,) at rest under input `u0` (%)."""
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    """One sample: input `u` (%) in, state (v,) out, v in % of travel at the sample's end."""
    x = min(max(u, 0.0), 100.0)
    v = state[0]
    d = 1.0 if x > v else -1.0
    left = p.Ts

    # distance within which the lag alone is slower than the limit
    if p.T > 0.0:
        near = p.rate * p.T
    else:
        near = 0.0
    far = abs(x - v) - near
    if far > 0.0:
        if far >= p.rate * left:
            return (v + d * p.rate * left,)
        v = x - d * near
        left = left - far / p.rate
    if p.T == 0.0:
        return (x,)
    return (x + (v - x) * exp(-left / p.T),)

"""Stiction that comes and goes: S and J for the first `on` seconds of every `period`, another band
for the rest.

When to choose it: a valve that sticks only now and then (deposits, a positioner that frees it), and
to see whether a detector judges the whole record by a part of it.
When not: one slow change (`time_varying`). Friction holds back, it never pushes: when it comes on
under a moving valve, the valve waits in place.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number
from simbench.valve.maps import stick

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, switched in"
    " time"
)
FRICTION = True
PARAMETERS = {
    "S": Number(
        "% of travel", low=0.0, high=100.0, says="dead-band plus stick band while it sticks"
    ),
    "J": Number("% of travel", low=0.0, high=100.0, says="slip jump while it sticks"),
    "period": Number("s", low=0.0, positive=True, says="time from one sticking spell to the next"),
    "on": Number("s", low=0.0, says="length of a sticking spell"),
    "delay": Number("s", low=0.0, default=0.0, says="begin of the first spell"),
    "S_off": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=0.0,
        says="dead-band plus stick band between spells",
    ),
    "J_off": Number(
        "% of travel", low=0.0, high=100.0, default=0.0, says="slip jump between spells"
    ),
}


def check(p):
    """Refuse a spell longer than its period."""
    if p.on > p.period:
        raise ParameterError(
            f"valve 'intermittent': on = {p.on:g} s is longer than period = {p.period:g} s"
        )


def start(u0, p):
    """Return the state (v, d, moving, u_prev, k) at rest in mid-band under OP `u0` (%); k counts
    samples.
    """
    x = min(max(u0, 0.0), 100.0)
    return x, 0.0, 0.0, x, 0.0


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, d, moving, u_prev, k) out, v = MV (%)."""
    v, d, moving, u_prev, k = state
    t = k * p.Ts - p.delay
    S = p.S_off
    J = p.J_off
    if t >= 0.0 and t % p.period < p.on:
        S = p.S
        J = p.J
    new, d, moving, u_prev = stick(u, (v, d, moving, u_prev), S, J)
    if (new - v) * d > 0.0:
        v = new
    return v, d, moving, u_prev, k + 1.0


def mapped_SJ(p):
    """Return (S, J) in % of travel of a sticking spell."""
    return p.S, p.J


def for_SJ(S, J, period):
    """Return the parameters that stick with (S, J) for 20 of every 30 periods of `period` (s), with
    0.4 of them in between.
    """
    return {
        "S": S,
        "J": J,
        "S_off": 0.4 * S,
        "J_off": 0.4 * J,
        "period": 30.0 * period,
        "on": 20.0 * period,
    }

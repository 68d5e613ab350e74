"""Travel limits, a stage: the position stays between a lower and an upper stop.

When to choose it: a valve with a mechanical stop, a minimum opening or a limited stroke, behind any
friction model; in front of one it limits the signal to the positioner instead.
When not: limits that the controller knows about; those belong to OP, whose integral must stop there
too.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number

SOURCE = "definition: low <= MV <= high"
FRICTION = False
PARAMETERS = {
    "low": Number("% of travel", low=0.0, high=100.0, default=0.0, says="lower stop"),
    "high": Number("% of travel", low=0.0, high=100.0, default=100.0, says="upper stop"),
}


def check(p):
    """Refuse stops in the wrong order."""
    if p.low >= p.high:
        raise ParameterError(
            f"valve 'limits': low = {p.low:g} must be below high = {p.high:g} (% of travel)"
        )


def start(u0, p):
    """Return the state (v,) under input `u0` (%)."""
    return (min(max(u0, p.low), p.high),)


def step(u, state, p):
    """One sample: input `u` (%) in, state (v,) out, v in % of travel."""
    return (min(max(u, p.low), p.high),)

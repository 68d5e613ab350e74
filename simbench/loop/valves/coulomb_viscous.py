"""Spring-and-diaphragm valve with Coulomb and viscous friction, without stiction: a dead-band with
a time constant.

When to choose it: a well-greased or spring-loaded packing, whose friction at rest is that of motion
(Fs = Fc, J = 0); the physics behind `deadband`.
When not: the valve jumps when it breaks away (`coulomb`, which has this as its case Fs = Fc).
The band may be given as S instead of Fc.
"""

from math import isnan

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import FOLLOWS, Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import (
    ACTUATOR,
    PUBLISHED_FRICTION,
    SUBSTEP,
    refuse_large_substep,
)
from simbench.loop.physical.motion import move

SOURCE = actuator.SOURCE
FRICTION = True
PARAMETERS = {
    "S": Number(
        "% of travel", low=0.0, high=100.0, default=FOLLOWS, says="dead-band, 200 Fc/(k stroke)"
    ),
    "Fc": Number(
        "N", low=0.0, default=FOLLOWS, says="Coulomb friction; 1423 when neither it nor S is given"
    ),
    **{name: ACTUATOR[name] for name in ("Fv", "m", "k", "stroke")},
    "dv": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=1e-9,
        says="speed below which the valve counts as standing",
    ),
    "substep": SUBSTEP,
}


def complete(values, where):
    """Fill Fc from S or S from Fc."""
    refuse_large_substep(values, where)
    percent = 200.0 / (values["k"] * values["stroke"])
    S = values["S"]
    Fc = values["Fc"]
    if isnan(S):
        if isnan(Fc):
            Fc = PUBLISHED_FRICTION[1]
        return {**values, "Fc": Fc, "S": percent * Fc}
    if not isnan(Fc):
        raise ParameterError(f"{where}: give S or Fc, not both; one follows from the other")
    return {**values, "Fc": S / percent}


def start(u0, p):
    """Return the state (v, rate) at rest in mid-band under OP `u0` (%); rate in %/s."""
    return min(max(u0, 0.0), 100.0), 0.0


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rate) out, v = MV (%) at the sample's end."""
    return move(u, state, p.S, 0.0, p)


def mapped_SJ(p):
    """Return (S, J) in % of travel; the overshoot of an underdamped actuator needs a jump and has
    none here.
    """
    return p.S, 0.0

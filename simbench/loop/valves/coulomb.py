"""Spring-and-diaphragm valve with break-away, Coulomb and viscous friction, solved exactly between
its stops.

When to choose it: the physics behind `choudhury` and `he`, and the judge between them. While OP
moves smoothly within the sampling period (some 10 ms) the valve slides like Choudhury's; when OP is
held for longer than some 0.1 s, the valve stops within every sample and advances in jumps like
He's. Noise does not stop it.
When not: slow OP ramps (below about 1 %/s), where real friction grows again as motion slows
(`stribeck`); elastic give before break-away (`lugre`).

The three classical laws by their parameters: Fs > Fc, Fv > 0 is stiction + Coulomb + viscous
friction (the default); Fs = Fc is Coulomb + viscous (`coulomb_viscous` takes only those); Fs = Fc,
Fv = 0 is Coulomb friction alone. S and J may be given instead of Fs and Fc. OP acts as a held force
on the spring over each sample, MV is the position at the sample's end. Underdamped actuators
overshoot, and hit their end stops without bouncing.
"""

from simbench.loop.parameters import Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, SUBSTEP, complete_actuator
from simbench.loop.physical.motion import move

SOURCE = actuator.SOURCE
FRICTION = True
PARAMETERS = {
    **ACTUATOR,
    "dv": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=1e-9,
        says="speed below which the valve counts as standing",
    ),
    "substep": SUBSTEP,
}

complete = complete_actuator
mapped_SJ = actuator.mapped_SJ


def start(u0, p):
    """Return the state (v, rate) at rest in mid-band under OP `u0` (%); rate in %/s."""
    return min(max(u0, 0.0), 100.0), 0.0


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rate) out, v = MV (%) at the sample's end."""
    return move(u, state, p.S, p.J, p)

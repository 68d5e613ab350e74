"""Karnopp's friction on a spring-and-diaphragm valve: any speed within a band DV around zero counts
as standing.

When to choose it: to compare with simulations that use Karnopp's band, or to see what the band
does: on an OP ramp slower than DV the valve cannot creep and advances in jumps.
When not: the band has no physical meaning; `coulomb` is the same valve with a band so small that it
does not show, and `stribeck` makes slow motion jump for a physical reason. Within the band friction
cancels the force up to Fs, beyond it Fc and Fv x' act. Solved exactly between its stops; Karnopp's
own fixed steps are `substep` > 0. S and J may be given instead of Fs and Fc.
"""

from simbench.loop.parameters import Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, SUBSTEP, complete_actuator
from simbench.loop.physical.motion import move

SOURCE = (
    "Karnopp (1985), J. Dynamic Systems, Measurement and Control 107, 100-103; actuator: "
    + actuator.SOURCE
)
FRICTION = True
# Karnopp gives no number for a valve: a tenth of the published Stribeck speed
PARAMETERS = {
    **ACTUATOR,
    "dv": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=2.54e-5,
        says="half width DV of the zero-velocity band",
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

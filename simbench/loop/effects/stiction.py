"""Stiction: MV sticks, then slips.

When it is the answer: OP draws a ramp against a PV that stands still, then jumps; the loop cycles
without outside help. It takes the place of an ideal valve's missing friction; a valve that already
has friction is refused.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number

SOURCE = "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658"
BLOCK = "valve"
PARAMETERS = {
    "S": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        identity=0.0,
        says="dead-band plus stick-band: OP travel needed to reverse MV",
    ),
    "J": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="slip-jump"),
}
ACTS = "loop"
ALIKE = ("friction",)


def apply(setup, p, rng):
    """Put the (S, J) map in front of the valve; a valve with friction cannot have a second one."""
    if setup.sticky:
        raise ParameterError(
            f"effect 'stiction' cannot be added to valve {setup.loop.valve.name!r}, which has"
            " friction already"
        )
    if p.S > 0.0 or p.J > 0.0:
        setup.add_valve("choudhury", {"S": p.S, "J": p.J}, first=True)

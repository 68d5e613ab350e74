"""Derivative action: OP answers the speed of PV as well.

When it is the answer: a PID where the documents know a PI.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: OP moves by Kc Td/Ts times the change of PV's filtered slope as well"
BLOCK = "controller"
PARAMETERS = {
    "Td": Number("s", low=0.0, default=0.0, identity=0.0, says="derivative time"),
    "filter": Number("s", low=0.0, default=0.0, identity=0.0, says="of the derivative"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Add a derivative to the controller's law."""
    if p.Td > 0.0:
        setup.derivative = p.Td, p.filter

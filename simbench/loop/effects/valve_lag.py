"""Valve lag: MV follows OP through a first-order lag, after any friction.

When it is the answer: a large actuator on a small positioner. From SP, OP and PV alone
it is one more series pole; MV tells it from the others.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: tau dMV/dt + MV = position asked for"
BLOCK = "valve"
PARAMETERS = {
    "tau": Number("s", low=0.0, identity=0.0, says="time constant"),
}
ACTS = "loop"
ALIKE = ("series pole",)


def apply(setup, p, rng):
    """Put the lag behind the valve."""
    if p.tau > 0.0:
        setup.add_valve("lag", {"T": p.tau})

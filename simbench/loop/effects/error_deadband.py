"""Error dead-band: the controller takes small errors for 0.

When it is the answer: OP stands still while PV wanders within a band about SP, then both move at
once.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: error = 0 while |SP - PV| <= width/2, unchanged outside (no offset)"
BLOCK = "controller"
PARAMETERS = {
    "width": Number("PV units", low=0.0, identity=0.0, says="full width"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Set the controller's gap."""
    setup.error_gap = max(setup.error_gap, p.width)

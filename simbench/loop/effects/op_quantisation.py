"""OP quantisation: OP reaches valve and record on a lattice.

When it is the answer: an output card of few bits, a controller that moves only by whole steps. Its
integral stays fine.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: OP = step round(OP/step), behind the controller's memory"
BLOCK = "controller"
PARAMETERS = {
    "step": Number("%", low=0.0, high=100.0, identity=0.0, says="lattice spacing; 0 = none"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Set the lattice of the output."""
    if p.step > 0.0:
        setup.op_step = p.step

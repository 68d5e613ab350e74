"""OP quantisation: OP reaches valve and record on a lattice.

When it is the answer: an output card of few bits, a controller that moves only by whole steps. Its integral stays fine.
"""

from simbench.gap.schema import parameters

SOURCE = "definition: OP = step round(OP/step), behind the controller's memory"
BLOCK = "controller"
PARAMETERS = parameters("op_quantisation", "step")
CONFUSABLE_WITH = ()
ACTS = "loop"


def apply(setup, p, rng):
    """Set the lattice of the output."""
    if p.step > 0.0:
        setup.op_quantum = p.step

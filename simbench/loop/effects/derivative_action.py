"""Derivative action: OP answers the speed of PV as well.

When it is the answer: a PID where the documents know a PI.
"""

from simbench.loop.laws import apply_law, law_parameters

SOURCE = "definition: simbench.loop.laws, form 'derivative'"
BLOCK = "controller"
PARAMETERS = law_parameters("derivative")
ACTS = "loop"


def apply(setup, p, rng):
    """Do what the law of this form does."""
    apply_law("derivative", setup, p, rng)

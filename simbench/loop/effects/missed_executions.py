"""Missed executions: the controller does not run in spells, and OP stands.

When it is the answer: an overloaded processor, or a loop left in manual: OP stands still where its
law would move it.
"""

from simbench.loop.laws import apply_law, law_parameters

SOURCE = "definition: simbench.loop.laws, form 'idle'"
BLOCK = "controller"
PARAMETERS = law_parameters("idle")
ACTS = "loop"


def apply(setup, p, rng):
    """Do what the law of this form does."""
    apply_law("idle", setup, p, rng)

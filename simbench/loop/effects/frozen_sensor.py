"""Frozen sensor: PV repeats its last value in spells.

When it is the answer: a plugged impulse line or a lost link: exact repeats while OP moves.
"""

from simbench.loop.laws import apply_law, law_parameters

SOURCE = "definition: simbench.loop.laws, form 'held'"
BLOCK = "sensor"
PARAMETERS = law_parameters("held")
ACTS = "loop"


def apply(setup, p, rng):
    """Do what the law of this form does."""
    apply_law("held", setup, p, rng)

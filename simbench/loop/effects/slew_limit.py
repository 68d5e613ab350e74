"""Slew limit: MV moves at a limited speed.

When it is the answer: starved air supply, an electric actuator, a large damper: MV follows small
moves of OP at once and large ones along a ramp.
"""

from simbench.loop.laws import apply_law, law_parameters

SOURCE = "definition: simbench.loop.laws, form 'rate'"
BLOCK = "valve"
PARAMETERS = law_parameters("rate")
ACTS = "loop"


def apply(setup, p, rng):
    """Do what the law of this form does."""
    apply_law("rate", setup, p, rng)

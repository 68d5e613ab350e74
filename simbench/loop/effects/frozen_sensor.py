"""Frozen sensor: PV repeats its last value in spells.

When it is the answer: a plugged impulse line or a lost link: exact repeats while OP moves.
"""

from simbench.loop.spells import SPELLS, spells

SOURCE = "definition: in spells the reading stands"
BLOCK = "sensor"
PARAMETERS = SPELLS
ACTS = "loop"


def apply(setup, p, rng):
    """Mark the samples in which the reading stands."""
    if p.share > 0.0:
        setup.frozen = spells(setup, p, rng)

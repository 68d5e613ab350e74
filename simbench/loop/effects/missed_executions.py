"""Missed executions: the controller does not run in spells, and OP stands.

When it is the answer: an overloaded processor, or a loop left in manual: OP stands still where its
law would move it.
"""

from simbench.loop.spells import SPELLS, spells

SOURCE = "definition: in spells the controller does not run, and remembers nothing of them"
BLOCK = "controller"
PARAMETERS = SPELLS
ACTS = "loop"


def apply(setup, p, rng):
    """Mark the samples in which the controller does not run."""
    if p.share > 0.0:
        setup.idle = spells(setup, p, rng)

"""Load steps: a load at the plant's input that jumps to a new level at random times.

When it is the answer: units switched on and off upstream. Slow ones look like drift.
"""

import numpy as np

from simbench.gap.schema import parameters

SOURCE = "definition: jumps of a Poisson process, levels normal with std `size` about the mean load"
BLOCK = "disturbance"
PARAMETERS = parameters("load_steps", "rate", "size")
CONFUSABLE_WITH = ("load_drift", "drift")
ACTS = "loop"


def apply(setup, p, rng):
    """Draw the jumps and add them to the load at the plant's input; the run begins at the mean load."""
    total = setup.sp.size
    jumps = rng.random(total) < -np.expm1(-p.rate * setup.Ts)
    levels = np.concatenate([[0.0], p.size * rng.standard_normal(total)])
    setup.load_in += setup.hold(levels[np.cumsum(jumps)])

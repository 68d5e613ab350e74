"""Load steps: a load at the plant's input that jumps to a new level at random times.

When it is the answer: units switched on and off upstream. Slow ones look like drift.
"""

import math

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "definition: jumps of a Poisson process, levels normal with std `size` about the mean load"
BLOCK = "disturbance"
PARAMETERS = {
    "rate": Number("1/s", low=0.0, identity=0.0, says="mean number of jumps per second"),
    "size": Number(
        "%", low=0.0, high=100.0, identity=0.0, says="std of the levels about the mean load"
    ),
}
ACTS = "loop"
ALIKE = ("slow",)


def apply(setup, p, rng):
    """Draw the jumps and add them to the load at the plant's input; the run begins at the mean
    load.
    """
    total = setup.sp.size
    jumps = rng.random(total) < -math.expm1(-p.rate * setup.Ts)
    levels = np.concatenate([[0.0], p.size * rng.standard_normal(total)])
    setup.load_in += setup.hold(levels[np.cumsum(jumps)])

"""Load drift: a slowly moving load at the plant's input.

When it is the answer: ambient temperature, a feed that changes over a shift. Slow ones
look like steps or like a drifting sensor.
"""

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "definition: ramp plus random walk on the load"
BLOCK = "disturbance"
PARAMETERS = {
    "rate": Number("%/s", default=0.0, says="ramp"),
    "walk": Number("%/sqrt(s)", low=0.0, default=0.0, says="random walk beside it"),
}
ACTS = "loop"
ALIKE = ("slow", "ramp")


def apply(setup, p, rng):
    """Add ramp and walk to the load at the plant's input."""
    total = setup.sp.size
    walk = np.cumsum(rng.standard_normal(total)) * (p.walk * np.sqrt(setup.Ts))
    setup.load_in += setup.hold(p.rate * setup.Ts * np.arange(total) + walk)

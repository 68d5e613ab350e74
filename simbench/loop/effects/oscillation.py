"""Oscillation: a sinusoidal load at the plant's input.

When it is the answer: PV and OP are sines of one sharp frequency that the loop by itself does not
have.
"""

import math

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.elementary import elementwise
from simbench.loop.parameters import Number

SOURCE = "definition: amplitude sin(2 pi t/period + phase), phase at random"
BLOCK = "disturbance"
PARAMETERS = {
    "amplitude": Number("%", low=0.0, high=100.0, identity=0.0, says="half peak-to-peak"),
    "period": Number("s", low=0.0, identity=100.0, says="period"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Add the sine to the load at the plant's input."""
    if p.amplitude == 0.0:
        return
    if p.period == 0.0:
        raise ParameterError("effect 'oscillation': period = 0; a time above 0 s is needed")
    phase = rng.uniform(0.0, 2.0 * np.pi)
    t = np.arange(setup.sp.size) * setup.Ts
    wave = elementwise(math.sin, 2.0 * np.pi * t / p.period + phase)
    setup.load_in += setup.hold(p.amplitude * wave)

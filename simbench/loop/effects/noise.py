"""Noise: more (or less) white noise on PV than the baseline states.

When it is the answer: a turbulent orifice, a failing transmitter. The controller sees it too and
passes it on to OP.
"""

from math import hypot

from simbench.loop.parameters import Number

SOURCE = "definition: std^2 = (factor std of the baseline)^2 + std^2"
BLOCK = "sensor"
PARAMETERS = {
    "factor": Number(
        "",
        low=0.0,
        high=1000.0,
        default=1.0,
        says="times the baseline's noise std; use it where that is above 0",
    ),
    "std": Number(
        "PV units",
        low=0.0,
        default=0.0,
        says="std added in quadrature; use it where the baseline has no noise",
    ),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Scale the noise and add to it in quadrature."""
    setup.noise_std = hypot(setup.noise_std * p.factor, p.std)

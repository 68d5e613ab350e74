"""Noise: more (or less) white noise on PV than the baseline states.

When it is the answer: a turbulent orifice, a failing transmitter. The controller sees it too and passes it on to OP.
"""

from math import hypot

from simbench.gap.schema import parameters

SOURCE = "definition: std^2 = (factor std of the baseline)^2 + std^2"
BLOCK = "sensor"
PARAMETERS = parameters("noise")
CONFUSABLE_WITH = ()
ACTS = "loop"


def apply(setup, p, rng):
    """Scale the noise and add to it in quadrature."""
    setup.noise_std = hypot(setup.noise_std * p.factor, p.std)

"""Extra lag: a second time constant between plant and PV, before the noise enters.

When it is the answer: a thermowell, a vessel the model left out. From SP, OP and PV alone it is one
more series pole.
"""

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "definition: G(s)/(tau s + 1)"
BLOCK = "process"
PARAMETERS = {
    "tau": Number("s", low=0.0, identity=0.0, says="time constant"),
}
ACTS = "loop"
ALIKE = ("series pole",)


def apply(setup, p, rng):
    """Give the plant another pole."""
    if p.tau > 0.0:
        setup.den = np.polymul(setup.den, [p.tau, 1.0])

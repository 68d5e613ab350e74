"""Time constant mismatch: the plant is slower or faster than the baseline (foptd only).

When it is the answer: another hold-up than the one the model was taken at. Standing still, only K/T
shows.
"""

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number

SOURCE = "definition: T of the plant = factor x T of the baseline"
BLOCK = "process"
PARAMETERS = {
    "factor": Number(
        "", low=0.05, high=20.0, identity=1.0, says="T of the plant / T of the baseline"
    ),
}
ACTS = "loop"
ALIKE = ("gain over time constant",)


def apply(setup, p, rng):
    """Move the baseline's pole, and leave what other effects added to the plant."""
    # A factor of 1 changes nothing
    if p.factor == 1.0:
        return
    own = setup.loop.plant
    T = own.T
    if T is None and own.den is None:
        raise ParameterError(
            f"effect 'time_constant_mismatch': plant {own.type!r} has no time constant"
        )

    # The poles of the loop file are divided out, and put back changed
    if T is not None:
        base = [T, 1.0]
    else:
        base = list(own.den)
    rest, remainder = np.polydiv(setup.den, base)
    if np.abs(remainder).max() > 1e-9 * max(base):
        raise ParameterError(
            "effect 'time_constant_mismatch': the plant has not the poles of its loop file"
        )
    order = len(base) - 1
    setup.den = np.polymul(rest, [c * p.factor ** (order - i) for i, c in enumerate(base)])

"""Drift: a slow error of the measurement, which the controller takes for PV.

When it is the answer: a fouled probe. PV stays on SP while OP wanders; on a self-regulating plant a
slow load does the same.
"""

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "definition: ramp plus random walk on the measured PV"
BLOCK = "sensor"
PARAMETERS = {
    "rate": Number("PV units/s", default=0.0, says="ramp"),
    "walk": Number("PV units/sqrt(s)", low=0.0, default=0.0, says="random walk beside it"),
}
ACTS = "loop"
ALIKE = ("slow", "ramp")


def apply(setup, p, rng):
    """Add ramp and walk to the measured PV."""
    total = setup.sp.size
    walk = np.cumsum(rng.standard_normal(total)) * (p.walk * np.sqrt(setup.Ts))
    setup.pv_add += setup.hold(p.rate * setup.Ts * np.arange(total) + walk)

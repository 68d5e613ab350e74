"""Sensor lag: a first-order filter smooths PV and its noise before the controller sees them.

When it is the answer: a damped transmitter. Its mark is noise that has lost its fast part.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: z(k) = z(k-1) + (1 - exp(-Ts/tau)) (PV + noise - z(k-1))"
BLOCK = "sensor"
PARAMETERS = {
    "tau": Number("s", low=0.0, identity=0.0, says="time constant"),
}
ACTS = "loop"
ALIKE = ("series pole",)


def apply(setup, p, rng):
    """Set the sensor's filter; on a filter that is there already, the time constants add."""
    setup.sensor_tau += p.tau

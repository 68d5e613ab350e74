"""Gain mismatch: the plant's gain is not the baseline's.

When it is the answer: another throughput than the one the model was taken at. Standing still, only K/T shows.
"""

from simbench.gap.schema import parameters

SOURCE = "definition: K of the plant = factor x K of the baseline"
BLOCK = "process"
PARAMETERS = parameters("gain_mismatch", "factor")
CONFUSABLE_WITH = ("time_constant_mismatch", "valve_characteristic", "deadzone")
ACTS = "loop"


def apply(setup, p, rng):
    """Scale the plant's gain."""
    setup.num = setup.num * p.factor

"""Gain mismatch: the plant's gain is not the baseline's.

When it is the answer: another throughput than the one the model was taken at. Standing still, only
K/T shows.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: K of the plant = factor x K of the baseline"
BLOCK = "process"
PARAMETERS = {
    "factor": Number(
        "", low=0.05, high=20.0, identity=1.0, says="K of the plant / K of the baseline"
    ),
}
ACTS = "loop"
ALIKE = ("local gain", "gain over time constant")


def apply(setup, p, rng):
    """Scale the plant's gain."""
    setup.num = setup.num * p.factor

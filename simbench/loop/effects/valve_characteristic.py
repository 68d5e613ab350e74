"""Valve characteristic: the gain from OP to MV changes along the travel.

When it is the answer: the loop is lively at one end and sluggish at the other. At one operating
point it is only another gain.
"""

from simbench.loop.parameters import Number

SOURCE = "IEC 60534-2-4 (2009), inherent characteristics; MV = 100 (R^(OP/100) - 1)/(R - 1)"
BLOCK = "valve"
PARAMETERS = {
    "R": Number(
        "",
        low=0.01,
        high=100.0,
        identity=1.0,
        says="ratio of the local gains at OP = 100 and OP = 0",
    ),
}
ACTS = "loop"
ALIKE = ("local gain",)


def apply(setup, p, rng):
    """Put the curve behind the valve; a constant load keeps op0 the operating point of rest."""
    if p.R != 1.0:
        straight = setup.resting_mv
        setup.add_valve("gain_ratio", {"R": p.R})
        setup.load_in += straight - setup.resting_mv

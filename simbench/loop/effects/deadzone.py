"""Dead-zone: MV rests while OP is within D/2 of c; no memory.

When it is the answer: split ranges that do not meet, an overlapped spool. While OP never meets the
zone it is a mere offset.
"""

from math import isnan

from simbench.loop.parameters import FOLLOWS, Number

SOURCE = "ISA-51.1 (1979), dead zone"
BLOCK = "valve"
PARAMETERS = {
    "D": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="full width of the zone"),
    "c": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        identity=50.0,
        says="centre; absent = op0 of the operating point",
    ),
}
ACTS = "loop"
ALIKE = ("local gain",)


def apply(setup, p, rng):
    """Put the zone in front of the valve, centred on op0 unless `c` is given; a constant load keeps
    op0 at rest.
    """
    if p.D > 0.0:
        before = setup.resting_mv
        setup.add_valve("deadzone", {"D": p.D, "c": setup.op0 if isnan(p.c) else p.c}, first=True)
        setup.load_in += before - setup.resting_mv

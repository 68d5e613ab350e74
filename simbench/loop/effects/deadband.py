"""Dead-band: backlash between OP and MV, without slip-jump.

When it is the answer: loose linkage; MV lags OP by S/2 whichever way it moves, and a
self-regulating PI loop does not cycle by it alone.
When not: MV jumps as it breaks away (`stiction`).
"""

from simbench.loop.parameters import Number

SOURCE = "ISA-51.1 (1979), dead band"
BLOCK = "valve"
PARAMETERS = {
    "S": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        identity=0.0,
        says="width of the band (offset while moving is S/2)",
    ),
}
ACTS = "loop"
ALIKE = ("friction",)


def apply(setup, p, rng):
    """Put a play operator of width S in front of the valve."""
    if p.S > 0.0:
        setup.add_valve("deadband", {"S": p.S}, first=True)

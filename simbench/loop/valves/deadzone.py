"""Dead-zone: the valve ignores OP within D/2 of one position, and follows with that offset outside.
No memory.

When to choose it: overlap of a spool in a positioner, a split range that does not meet, a
controller gap.
When not: friction or backlash, whose band travels with the valve (`deadband`). A dead-zone has no
phase lag (its describing function is real), so by itself it cannot keep a stable loop oscillating.
The travel lost in the zone is lost at the ends: MV stays within D/2 of them.
"""

from simbench.loop.parameters import Number
from simbench.valve.maps import zone

SOURCE = "ISA-51.1 (1979), dead zone; v = c + sign(u - c) max(|u - c| - D/2, 0)"
FRICTION = False
PARAMETERS = {
    "D": Number("% of travel", low=0.0, high=100.0, says="width of the zone"),
    "c": Number("% of travel", low=0.0, high=100.0, default=50.0, says="centre of the zone"),
}


def start(u0, p):
    """Return the state (v,) under OP `u0` (%)."""
    return step(u0, (0.0,), p)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v,) out, v = MV (%)."""
    return (zone(u, p.D, p.c),)

"""Slew limit: MV moves at a limited speed.

When it is the answer: starved air supply, an electric actuator, a large damper: MV follows small
moves of OP at once and large ones along a ramp.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: MV moves by at most Ts/slowness a sample, and behind a lag tau"
BLOCK = "valve"
PARAMETERS = {
    "slowness": Number("s/%", low=0.0, default=0.0, identity=0.0, says="time for 1 % of travel"),
    "tau": Number("s", low=0.0, default=0.0, identity=0.0, says="time constant"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Limit the speed of the valve, and let it lag."""
    if p.slowness > 0.0 or p.tau > 0.0:
        if p.slowness > 0.0:
            rate = {"rate": 1.0 / p.slowness}
        else:
            rate = {}
        setup.add_valve("lag", {"T": p.tau, **rate})

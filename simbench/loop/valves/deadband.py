"""Dead-band (backlash, play): the valve follows OP only after OP has crossed the band.

When to choose it: loose linkage, worn gears, or friction without slip jump (J = 0). Two parameters'
worth of `choudhury` at J = 0 in one line, without its dependence on when OP pauses.
When not: a valve that jumps when it breaks away (`choudhury`, or a physical model); an insensitive
range around one position that leaves no memory (`deadzone`). While moving the valve lags OP by S/2;
the band is S.
"""

from simbench.loop.parameters import Number
from simbench.valve.maps import play

SOURCE = "ISA-51.1 (1979), dead band; play operator: Krasnosel'skii and Pokrovskii (1989)"
FRICTION = True
PARAMETERS = {"S": Number("% of travel", low=0.0, high=100.0, says="width of the band")}


def start(u0, p):
    """Return the state (v,) at rest in mid-band under OP `u0` (%)."""
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v,) out, v = MV (%)."""
    return (play(u, state[0], p.S),)


def mapped_SJ(p):
    """Return (S, J) in % of travel."""
    return p.S, 0.0

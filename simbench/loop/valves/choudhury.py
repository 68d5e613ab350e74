"""Choudhury's two-parameter stiction: stick band J inside a dead-band, slip jump J, together the
width S.

When to choose it: the default data-driven model, and the one the tables and describing functions of
the field speak of. J = 0 is pure dead-band, J < S undershoots by (S - J)/2 while moving, J = S
follows OP exactly, J > S overshoots.
When not: noisy OP. Every reversal of OP by noise stops the valve and a restart needs J, so the
moving phase turns into a staircase; nor does it stop by itself when OP creeps towards a limit. A
physical model (`coulomb`, `stribeck`) does neither.

Where the published flowchart is silent: a band starts where a *moving* valve stops, and the
threshold knows the direction. `choudhury_literal` takes the other reading.
"""

from simbench.loop.parameters import Number
from simbench.valve.maps import at_rest, stick

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, data-driven"
    " model"
)
FRICTION = True
PARAMETERS = {
    "S": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band"),
    "J": Number("% of travel", low=0.0, high=100.0, says="slip jump"),
}


def start(u0, p):
    """Return the state (v, d, moving, u_prev) at rest in mid-band under OP `u0` (%)."""
    return at_rest(u0)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, d, moving, u_prev) out, v = MV (%)."""
    return stick(u, state, p.S, p.J)


def mapped_SJ(p):
    """Return (S, J) in % of travel."""
    return p.S, p.J

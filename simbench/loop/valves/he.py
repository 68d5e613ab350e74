"""He's stiction model: when OP - MV passes fs the valve slips down to fd, and sticks again at every
sample.

When to choose it: sampled loops whose valve comes to rest between two samples (sampling slower than
some 0.1 s with the published actuator): there friction does stop the valve at every sample, and
this map is what `coulomb` does.
When not: OP that moves smoothly within the sampling period; the real valve then slides
(`choudhury`), while this one advances in jumps of J. The result depends on the sampling period.

Band by S and J, or by the published pair fs = (S + J)/2 and fd = (S - J)/2. K is the later gain on
the slip: 1 is the original; up to 2 the valve overshoots its balance, as an underdamped actuator
does (K = 1 + its overshoot ratio). The published form has no limits; here OP and MV stay within
0..100.
"""

from simbench.loop.parameters import FOLLOWS, Number
from simbench.loop.physical.actuator import complete_band
from simbench.valve.maps import creep

SOURCE = (
    "He, Wang, Pottmann and Qin (2007), Ind. Eng. Chem. Res. 46, 4549-4560; K: He and Wang"
    " (2010), ACC"
)
FRICTION = True
PARAMETERS = {
    "S": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        says="dead-band plus stick band, fs + fd",
    ),
    "J": Number("% of travel", low=0.0, high=100.0, default=FOLLOWS, says="slip jump, fs - fd"),
    "fs": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        says="residual at which the valve slips",
    ),
    "fd": Number(
        "% of travel", low=-50.0, high=100.0, default=FOLLOWS, says="residual after the slip"
    ),
    "K": Number("", low=1.0, high=2.0, default=1.0, says="gain on the slip"),
}


def complete(values, where):
    """Fill fs and fd from S and J, or S and J from fs and fd."""
    return complete_band(values, where, ("fs", "fd"), 1.0, overshoot=True)


def start(u0, p):
    """Return the state (v,) at rest in mid-band under OP `u0` (%)."""
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v,) out, v = MV (%)."""
    return (creep(u, state[0], p.S, p.J, p.K),)


def mapped_SJ(p):
    """Return (S, J) in % of travel: K widens the jump at the cost of the rest of the band,
    break-away stays.
    """
    return p.S - (p.K - 1.0) * p.J, p.K * p.J

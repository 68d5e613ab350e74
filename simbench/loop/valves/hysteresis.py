"""Hysteresis with or without dead-band (ISA): eight plays of different width in parallel, their
mean is the position.

When to choose it: a positioner or linkage whose loop opens gradually after each reversal instead of
standing still (S = 0: no dead-band, the loop closes at both ends), or any rate-independent loop
between that and backlash.
When not: a sharp dead-band (`deadband`, which is H = 0 in one line) or slip jumps (`choudhury`).

S is the dead-band; H is hysteresis as ISA measures it on the output: the largest separation of the
rising and falling curve over a full traverse, less the dead-band. The plays have equal weights and
widths S, S + 2H/7, ... S + 2H.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number
from simbench.valve.maps import play

SOURCE = (
    "ISA-51.1 (1979), hysteresis; Prandtl-Ishlinskii operator: Krasnosel'skii and Pokrovskii (1989)"
)
FRICTION = True
PARAMETERS = {
    "S": Number("% of travel", low=0.0, high=100.0, default=0.0, says="dead-band"),
    "H": Number(
        "% of travel", low=0.0, high=50.0, says="hysteresis: separation beyond the dead-band"
    ),
}


def check(p):
    """Refuse a play wider than the travel."""
    if p.S + 2.0 * p.H > 100.0:
        raise ParameterError(
            f"valve 'hysteresis': S + 2 H = {p.S + 2.0 * p.H:g} exceeds the travel of 100 %"
        )


def start(u0, p):
    """Return the state (v, eight play positions) at rest in mid-band under OP `u0` (%)."""
    x = min(max(u0, 0.0), 100.0)
    return x, x, x, x, x, x, x, x, x


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, eight play positions) out, v = MV (%)."""
    x = min(max(u, 0.0), 100.0)
    more = p.H / 7.0
    p1 = play(x, state[1], p.S)
    p2 = play(x, state[2], p.S + 2.0 * more)
    p3 = play(x, state[3], p.S + 4.0 * more)
    p4 = play(x, state[4], p.S + 6.0 * more)
    p5 = play(x, state[5], p.S + 8.0 * more)
    p6 = play(x, state[6], p.S + 10.0 * more)
    p7 = play(x, state[7], p.S + 12.0 * more)
    p8 = play(x, state[8], p.S + 14.0 * more)

    # summed in pairs: equal plays then give their common value without rounding
    v = 0.125 * (((p1 + p2) + (p3 + p4)) + ((p5 + p6) + (p7 + p8)))
    return v, p1, p2, p3, p4, p5, p6, p7, p8


def mapped_SJ(p):
    """Return (S, J) in % of travel: the dead-band of the same separation over a full traverse."""
    return p.S + p.H, 0.0


def for_SJ(S, J, period):
    """Return the parameters of this separation, half of it dead-band; it has no slip jump."""
    return {"S": 0.5 * S, "H": 0.5 * S}

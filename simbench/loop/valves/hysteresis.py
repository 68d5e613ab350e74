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
    half = 0.5 * p.S
    more = p.H / 7.0
    p1 = play(x, half, state[1])
    p2 = play(x, half + more, state[2])
    p3 = play(x, half + 2.0 * more, state[3])
    p4 = play(x, half + 3.0 * more, state[4])
    p5 = play(x, half + 4.0 * more, state[5])
    p6 = play(x, half + 5.0 * more, state[6])
    p7 = play(x, half + 6.0 * more, state[7])
    p8 = play(x, half + 7.0 * more, state[8])
    # summed in pairs: equal plays then give their common value without rounding
    v = 0.125 * (((p1 + p2) + (p3 + p4)) + ((p5 + p6) + (p7 + p8)))
    return v, p1, p2, p3, p4, p5, p6, p7, p8


def play(x, half, v):
    """Return the position of a play of width 2 `half` (%) that stood at `v` (%), under OP `x`
    (%).
    """
    return max(x - half, min(x + half, v))


def mapped_SJ(p):
    """Return (S, J) in % of travel: the dead-band of the same separation over a full traverse."""
    return p.S + p.H, 0.0


def for_SJ(S, J, period):
    """Return the parameters of this separation, half of it dead-band; it has no slip jump."""
    return {"S": 0.5 * S, "H": 0.5 * S}

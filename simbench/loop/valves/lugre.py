"""LuGre friction on a spring-and-diaphragm valve: elastic bristles that give before they slip.

When to choose it: micro-motion before break-away matters (dither, small reversals, a
high-resolution positioner), or a friction model without switching is wanted.
When not: long closed-loop studies (some 50 us per sample, a thousand times `coulomb`); noisy OP,
under which bristles creep where a real valve stands, the more the softer they are.

Friction s0 z + s1 z' + Fv x', z' = x' - |x'| z/g(x'), s0 g = Fc + (Fs - Fc) exp(-(x'/vs)^2). Before
break-away the valve yields by OP's share k/s0. S and J may be given instead of Fs and Fc; they hold
up to that give. Needs Fc > 0. The force runs in a straight line from the last OP to this one over
the sample: bristles under a sudden force slip at Fc instead of Fs, and no air supply makes a step.
Break-away still falls with the rate of OP, as the source shows: at 2 %/s and S = 5, J = 2 by 16 %,
3 % and 0.5 % for s0 = 1e7, 1e8 and 1e9 N/m. With 1e7 a loop can settle within the give of the
bristles and never cycle. A sample of minutes is no ramp of minutes, in which the valve would stick
and slip a million times: `supply` is the time that the air takes to follow OP, held afterwards.
"""

from math import inf, isnan, sqrt

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import FOLLOWS, Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, PUBLISHED_FRICTION
from simbench.loop.physical.bristles import slide_bristles
from simbench.loop.physical.mapping import complete_band

SOURCE = (
    "Canudas de Wit, Olsson, Astrom and Lischinsky (1995), IEEE Trans. Automatic Control 40,"
    " 419-425; actuator: " + actuator.SOURCE
)
FRICTION = True
# The paper's 1e5 N/m belongs to a mass of 1 kg under 1.5 N of friction. 1e8 gives some um before
# break-away.
PARAMETERS = {
    **ACTUATOR,
    "vs": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=0.000254,
        says="Stribeck speed (published: 0.01 in/s)",
    ),
    "s0": Number("N/m", low=0.0, positive=True, default=1e8, says="bristle stiffness"),
    "s1": Number(
        "N s/m", low=0.0, default=FOLLOWS, says="bristle damping; 2 sqrt(s0 m) when absent"
    ),
    "supply": Number(
        "s",
        low=0.0,
        positive=True,
        default=FOLLOWS,
        says="time of the force's ramp; the sample when absent",
    ),
}


def complete(values, where):
    """Fill Fs and Fc or S and J, and the bristles' damping."""
    percent = 100.0 / (values["k"] * values["stroke"])
    values = complete_band(values, where, ("Fs", "Fc"), percent, PUBLISHED_FRICTION)
    if values["Fc"] <= 0.0:
        raise ParameterError(
            f"{where} needs Fc > 0 (J < S): its bristles slip in proportion to 1/Fc at speed"
        )
    if isnan(values["supply"]):
        values["supply"] = inf
    if isnan(values["s1"]):
        values["s1"] = 2.0 * sqrt(values["s0"] * values["m"])
    return values


def start(u0, p):
    """Return the state (v, rate, z, h, u_prev) at rest in mid-band under OP `u0`: in %, %/s, %, s,
    %.
    """
    x = min(max(u0, 0.0), 100.0)
    return x, 0.0, 0.0, 1e-6, x


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rate, z, h, u_prev) out, v = MV (%) at the sample's
    end.
    """
    v, rate, z, h, u_prev = state
    x = min(max(u, 0.0), 100.0)
    fs = 0.5 * (p.S + p.J)
    fd = 0.5 * (p.S - p.J)
    vs = 100.0 * p.vs / p.stroke
    first = min(p.Ts, p.supply)
    ramp = (x - u_prev) / first
    a = 0.5 * p.Fv / p.m
    w2 = p.k / p.m
    g0 = p.s0 / p.m
    g1 = p.s1 / p.m
    v, rate, z, h = slide_bristles(
        u_prev, ramp, v, rate, z, h, fs, fd, vs, a, w2, g0, g1, p.k / p.s0, first
    )
    if first < p.Ts:
        v, rate, z, h = slide_bristles(
            x, 0.0, v, rate, z, h, fs, fd, vs, a, w2, g0, g1, p.k / p.s0, p.Ts - first
        )
    return v, rate, z, h, x


mapped_SJ = actuator.mapped_SJ

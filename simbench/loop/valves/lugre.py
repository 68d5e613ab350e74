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

from math import exp, inf, isnan, nan, sqrt

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import FOLLOWS, Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, PUBLISHED_FRICTION, complete_band

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
    # The valve's numbers per unit of mass
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

    # The supply limits how fast the pressure follows OP, then it rests
    v, rate, z, h = slide_bristles(
        u_prev, ramp, v, rate, z, h, fs, fd, vs, a, w2, g0, g1, p.k / p.s0, first
    )
    if first < p.Ts:
        v, rate, z, h = slide_bristles(
            x, 0.0, v, rate, z, h, fs, fd, vs, a, w2, g0, g1, p.k / p.s0, p.Ts - first
        )
    return v, rate, z, h, x


mapped_SJ = actuator.mapped_SJ


# --- Motion with LuGre friction: stiff bristles, integrated by an implicit method with adaptive
# step.
#
# Position x in % of travel, rate r in %/s, bristle deflection z in % of travel; a and w2 as in
# actuator.py, g0 = s0/m and g1 = s1/m of the bristles' stiffness and damping, soft = k/s0 turns a
# friction in % into a deflection in %.

# per sample; a held OP takes about 200 steps until all is at rest, however long it is held
_MAX_STEPS = 1_000_000
# error allowed per step, % of travel, in position and in bristle deflection (relative to its
# largest value there)
_TOLERANCE = 1e-7
# under a held force that the bristles can carry, slower than this (%/s) and balanced to this share
# of fs: at rest
_REST = 1e-4
_BALANCE = 1e-6
_ROSENBROCK_D = 1.0 / (2.0 + sqrt(2.0))
_E32 = 6.0 + sqrt(2.0)


def slide_bristles(u, ramp, x, r, z, h, fs, fd, vs, a, w2, g0, g1, soft, T):
    """Return (position, rate, deflection, h) after T s under OP `u` + `ramp` t; h is the step (s)
    to try next.

    All NaN when the motion took more than `_MAX_STEPS` steps. Rosenbrock method of order 2 with
    error estimate (Shampine and Reichelt 1997, ode23s), whose order does not hang on the kink of
    |r| in the Jacobian.
    """
    # All of the time is used up, or the valve rests in balance
    for _ in range(_MAX_STEPS):
        if T <= 0.0:
            return x, r, z, h
        if (
            ramp == 0.0
            and abs(r) < _REST
            and abs(u - x) < fs
            and abs(w2 * (u - x) - g0 * z) < _BALANCE * w2 * fs
        ):
            return x, 0.0, z, h

        # Three stages of a Rosenbrock step
        t = min(h, T)
        acc, slip, acc_r, acc_z, slip_r, slip_z = slopes(
            u, x, r, z, fs, fd, vs, a, w2, g0, g1, soft
        )
        c = t * _ROSENBROCK_D
        push = c * w2 * ramp
        x1, r1, z1 = solve(c, r, acc + push, slip, w2, acc_r, acc_z, slip_r, slip_z)
        half = 0.5 * t
        rm = r + half * r1
        am, sm, _, _, _, _ = slopes(
            u + ramp * half, x + half * x1, rm, z + half * z1, fs, fd, vs, a, w2, g0, g1, soft
        )
        x2, r2, z2 = solve(c, rm - x1, am - r1, sm - z1, w2, acc_r, acc_z, slip_r, slip_z)
        x2 += x1
        r2 += r1
        z2 += z1
        x_new = x + t * x2
        r_new = r + t * r2
        z_new = z + t * z2
        an, sn, _, _, _, _ = slopes(
            u + ramp * t, x_new, r_new, z_new, fs, fd, vs, a, w2, g0, g1, soft
        )
        x3, _, z3 = solve(
            c,
            r_new - _E32 * (x2 - rm) - 2.0 * (x1 - r),
            an - _E32 * (r2 - am) - 2.0 * (r1 - acc) + push,
            sn - _E32 * (z2 - sm) - 2.0 * (z1 - slip),
            w2, acc_r, acc_z, slip_r, slip_z,
        )  # fmt: skip

        # The error of the step decides whether it counts, and how long the next is
        error = (
            t
            / 6.0
            * max(abs(x1 - 2.0 * x2 + x3), abs(z1 - 2.0 * z2 + z3) / (fs * soft))
            / _TOLERANCE
        )
        if error > 1.0:
            h = t * max(0.2, 0.8 * error**-0.3333333333333333)
            continue
        if t == h:
            h = t * min(5.0, 0.8 * max(error, 1e-6) ** -0.3333333333333333)

        # The end of the step; travel has ends
        T = T - t
        u = u + ramp * t
        x = x_new
        r = r_new
        z = z_new
        if x < 0.0 or x > 100.0:
            x = min(max(x, 0.0), 100.0)
            r = 0.0
    return nan, nan, nan, nan


def slopes(u, x, r, z, fs, fd, vs, a, w2, g0, g1, soft):
    """Return acceleration, bristle slip rate, and the derivatives of both by rate and by
    deflection.
    """
    weight = (fs - fd) * exp(-(r / vs) * (r / vs))
    g = soft * (fd + weight)
    speed = abs(r)
    slip = r - speed * z / g
    slip_z = -speed / g
    slip_r = (
        1.0
        - (z / g if r >= 0.0 else -z / g)
        - speed * z / g * (2.0 * r / (vs * vs)) * weight * soft / g
    )
    acc = w2 * (u - x) - g0 * z - g1 * slip - 2.0 * a * r
    return acc, slip, -2.0 * a - g1 * slip_r, -g0 - g1 * slip_z, slip_r, slip_z


def solve(c, bx, br, bz, w2, acc_r, acc_z, slip_r, slip_z):
    """Return the solution of (1 - c J) (x, r, z) = (bx, br, bz), J the Jacobian of (rate,
    acceleration, slip).
    """
    q = 1.0 - c * slip_z
    r = (br - c * w2 * bx + c * acc_z * bz / q) / (
        1.0 - c * acc_r + c * c * w2 - c * c * acc_z * slip_r / q
    )
    return bx + c * r, r, (bz + c * slip_r * r) / q

"""Spring-and-diaphragm valve whose friction grows again as it slows down (Stribeck): it stops early
and jumps on.

When to choose it: slow OP, as closed loops with weak integral action make it. Below about vs (0.25
% of travel per second) steady sliding is unstable, and a slow ramp moves the valve in repeated
jumps, as He's map does, where `coulomb` jumps once and slides.
When not: OP moves by several vs most of the time, or is held so long that the valve stops in every
sample; there it is `coulomb` at several times the cost.

Moving friction Fc + (Fs - Fc) exp(-(x'/vs)^2) + Fv x'. Exact between events while the valve is
fast, adaptive steps below 6 vs. S and J may be given instead of Fs and Fc.
"""

from math import exp, nan

from simbench.loop.parameters import Number
from simbench.loop.physical import actuator
from simbench.loop.physical.actuator import ACTUATOR, SUBSTEP, complete_actuator
from simbench.loop.physical.motion import (
    arrival_time,
    fall_time,
    free,
    slide_in_substeps,
    stop_time,
)

SOURCE = (
    "Stribeck curve in the exponential form of Armstrong-Helouvry (1991); actuator: "
    + actuator.SOURCE
)
FRICTION = True
PARAMETERS = {
    **ACTUATOR,
    "vs": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=0.000254,
        says="Stribeck speed (published: 0.01 in/s)",
    ),
    "dv": Number(
        "m/s",
        low=0.0,
        positive=True,
        default=1e-9,
        says="speed below which the valve counts as standing",
    ),
    "substep": SUBSTEP,
}

complete = complete_actuator
mapped_SJ = actuator.mapped_SJ


def start(u0, p):
    """Return the state (v, rate, h) at rest in mid-band under OP `u0` (%); rate in %/s, h is a step
    size in s.
    """
    return min(max(u0, 0.0), 100.0), 0.0, 1e-6


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, rate, h) out, v = MV (%) at the sample's end."""
    v, rate, h = state
    x = min(max(u, 0.0), 100.0)
    fs = 0.5 * (p.S + p.J)
    fd = 0.5 * (p.S - p.J)
    vs = 100.0 * p.vs / p.stroke
    a = 0.5 * p.Fv / p.m
    w2 = p.k / p.m
    rest = 100.0 * p.dv / p.stroke
    if p.substep > 0.0:
        v, rate = slide_in_substeps(x, v, rate, fs, fd, vs, a, w2, rest, p.Ts, p.substep)
        return v, rate, h
    return slide_stribeck(x, v, rate, h, fs, fd, vs, a, w2, rest, p.Ts)


# --- Motion with Stribeck friction: exact while fast, adaptive Runge-Kutta in the tail where
# friction grows again.
#
# Units as in motion.py; vs is the Stribeck speed in %/s. Friction that falls with speed throws the
# valve through the tail within some 10 us, in either direction; a valve on a steep ramp may also
# slide along in it.

# at 6 vs the Stribeck force is down to exp(-36), rounding error
_FAR = 6.0
# per sample; a passage of the tail takes about 100 steps, sliding in it about 200 per second
_MAX_STEPS = 1_000_000
# error allowed per step: in % of travel, and as a share of the larger of rate and vs
TOLERANCE_X = 1e-10
TOLERANCE_R = 1e-8


def slide_stribeck(u, x, r, h, fs, fd, vs, a, w2, rest, T):
    """Return (position, rate, h) after T s under OP `u`; h is the Runge-Kutta step (s) to try next.

    (NaN, NaN, NaN) when the motion took more than `_MAX_STEPS` steps.
    """
    # All of the time is used up, or the valve rests
    for _ in range(_MAX_STEPS):
        if T <= 0.0:
            return x, r, h
        if r == 0.0:
            if abs(u - x) <= fs:
                return x, 0.0, h
            d = 1.0 if u > x else -1.0
        else:
            d = 1.0 if r > 0.0 else -1.0
        # a little above FAR, so that a motion that has just fallen to it is in the tail
        if d * r > 1.01 * _FAR * vs:
            z = x - (u - d * fd)
            t = min(stop_time(z, r, a, w2), T)
            z1, r1 = free(z, r, a, w2, t)
            if d * r1 <= _FAR * vs:
                t = fall_time(z, r, d, _FAR * vs, a, w2, t)
                z1, r1 = free(z, r, a, w2, t)
            x1 = x + (z1 - z)
            if x1 < 0.0 or x1 > 100.0:
                x1 = min(max(x1, 0.0), 100.0)
                t = arrival_time(z, r, d, z + (x1 - x), a, w2, t)
                r1 = 0.0
        else:
            t = min(h, T)
            x1, r1, error = runge_kutta(u, x, r, d, t, fs, fd, vs, a, w2)
            if error > 1.0:
                h = t * max(0.2, 0.9 * error**-0.2)
                continue
            if d * r1 < -rest:
                # past the stop: again, up to where a straight line says that the rate is zero
                h = t * max(0.1, r / (r - r1))
                continue
            if t == h:
                h = t * min(5.0, 0.9 * max(error, 1e-4) ** -0.2)
            if d * r1 <= rest and d * r1 < d * r:
                r1 = 0.0
            x1 = min(max(x1, 0.0), 100.0)

        # The end of this step
        x = x1
        r = r1
        T = T - t
    return nan, nan, nan


def runge_kutta(u, x, r, d, h, fs, fd, vs, a, w2):
    """Return (position, rate, error) one step h later; error 1 is what is allowed. Dormand and
    Prince (1980), 5(4).
    """
    # Stages one to four
    k1 = _acceleration(u, x, r, d, fs, fd, vs, a, w2)
    r2 = r + h * (k1 / 5.0)
    k2 = _acceleration(u, x + h * (r / 5.0), r2, d, fs, fd, vs, a, w2)
    r3 = r + h * (3.0 / 40.0 * k1 + 9.0 / 40.0 * k2)
    k3 = _acceleration(u, x + h * (3.0 / 40.0 * r + 9.0 / 40.0 * r2), r3, d, fs, fd, vs, a, w2)
    r4 = r + h * (44.0 / 45.0 * k1 - 56.0 / 15.0 * k2 + 32.0 / 9.0 * k3)
    k4 = _acceleration(
        u, x + h * (44.0 / 45.0 * r - 56.0 / 15.0 * r2 + 32.0 / 9.0 * r3), r4, d, fs, fd, vs, a, w2
    )

    # Stage five, with its own weights
    c1 = 19372.0 / 6561.0
    c2 = -25360.0 / 2187.0
    c3 = 64448.0 / 6561.0
    c4 = -212.0 / 729.0
    r5 = r + h * (c1 * k1 + c2 * k2 + c3 * k3 + c4 * k4)
    k5 = _acceleration(u, x + h * (c1 * r + c2 * r2 + c3 * r3 + c4 * r4), r5, d, fs, fd, vs, a, w2)

    # Stage six
    c1 = 9017.0 / 3168.0
    c2 = -355.0 / 33.0
    c3 = 46732.0 / 5247.0
    c4 = 49.0 / 176.0
    c5 = -5103.0 / 18656.0
    r6 = r + h * (c1 * k1 + c2 * k2 + c3 * k3 + c4 * k4 + c5 * k5)
    k6 = _acceleration(
        u, x + h * (c1 * r + c2 * r2 + c3 * r3 + c4 * r4 + c5 * r5), r6, d, fs, fd, vs, a, w2
    )

    # The step of fifth order
    c1 = 35.0 / 384.0
    c3 = 500.0 / 1113.0
    c4 = 125.0 / 192.0
    c5 = -2187.0 / 6784.0
    c6 = 11.0 / 84.0
    x1 = x + h * (c1 * r + c3 * r3 + c4 * r4 + c5 * r5 + c6 * r6)
    r1 = r + h * (c1 * k1 + c3 * k3 + c4 * k4 + c5 * k5 + c6 * k6)

    # The last stage, and the difference to fourth order
    k7 = _acceleration(u, x1, r1, d, fs, fd, vs, a, w2)
    e1 = 71.0 / 57600.0
    e3 = -71.0 / 16695.0
    e4 = 71.0 / 1920.0
    e5 = -17253.0 / 339200.0
    e6 = 22.0 / 525.0
    e7 = -1.0 / 40.0
    error_x = h * abs(e1 * r + e3 * r3 + e4 * r4 + e5 * r5 + e6 * r6 + e7 * r1)
    error_r = h * abs(e1 * k1 + e3 * k3 + e4 * k4 + e5 * k5 + e6 * k6 + e7 * k7)
    return x1, r1, max(error_x / TOLERANCE_X, error_r / (TOLERANCE_R * max(abs(r1), vs)))


def _acceleration(u, x, r, d, fs, fd, vs, a, w2):
    """Return the acceleration (%/s2) of a valve that moves in direction d against Stribeck and
    viscous friction.
    """
    return w2 * (u - x - d * (fd + (fs - fd) * exp(-(r / vs) * (r / vs)))) - 2.0 * a * r

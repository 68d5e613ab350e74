"""Motion with LuGre friction: stiff bristles, integrated by an implicit method with adaptive step.

Position x in % of travel, rate r in %/s, bristle deflection z in % of travel; a and w2 as in
actuator.py, g0 = s0/m and g1 = s1/m of the bristles' stiffness and damping, soft = k/s0 turns a
friction in % into a deflection in %.
"""

from math import exp, nan, sqrt

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

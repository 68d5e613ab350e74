"""Exact motion of mass, spring, Coulomb and viscous friction under a held OP: from event to event,
no time steps; its twin in fixed sub-steps, and one sample by either.

Positions in % of travel, rates in %/s, times in s; `a` and `w2` as in actuator.py. z is the
distance of the valve from where it would come to rest if it went on sliding. The formulas hold for
any damping.
"""

from math import atan, ceil, cos, exp, inf, log, nan, pi, sin, sqrt

# phases of motion within one sample; only an almost undamped valve on a stiff spring needs more
# than a few
_MAX_EVENTS = 10_000


def slide(u, x, r, fs, fd, a, w2, rest, T):
    """Return (position, rate) after T s under OP `u`; a rate that has fallen to `rest` counts as
    standing.

    (NaN, NaN) when the valve was still stopping and starting after `_MAX_EVENTS` phases.
    """
    # At rest the valve breaks away only against more than the static force
    for _ in range(_MAX_EVENTS):
        if r == 0.0:
            if abs(u - x) <= fs:
                return x, 0.0
            d = 1.0 if u > x else -1.0
        else:
            d = 1.0 if r > 0.0 else -1.0

        # The course until the rate falls to rest, is zero, or the time is over
        z = x - (u - d * fd)
        t = fade_time(z, r, d, rest, a, w2)
        if t <= T:
            return u - d * fd - d * rest * (a + sqrt(a * a - w2)) / w2, 0.0
        t = stop_time(z, r, a, w2)
        stops = t <= T
        if not stops:
            t = T

        # A rate that falls below `rest` on the way stops there
        z1, r1 = free(z, r, a, w2, t)
        if not stops and d * r1 <= rest and d * (w2 * z1 + 2.0 * a * r1) > 0.0:
            stops = True
            t = fall_time(z, r, d, rest, a, w2, T)
            if t == 0.0:
                return x, 0.0
            z1, r1 = free(z, r, a, w2, t)

        # The ends of travel stop it as well
        x1 = x + (z1 - z)
        if x1 < 0.0 or x1 > 100.0:
            stops = True
            x1 = min(max(x1, 0.0), 100.0)
            t = arrival_time(z, r, d, z + (x1 - x), a, w2, t)

        # Moving to the end of the time, or at rest for what is left of it
        if not stops:
            return x1, r1
        x = x1
        r = 0.0
        T = T - t
    return nan, nan


def free(z, r, a, w2, t):
    """Return (z, r) after t s of z'' + 2 a z' + w2 z = 0."""
    # Critical damping, overdamped, underdamped
    b2 = a * a - w2
    if abs(b2) <= 1e-12 * w2:
        c = exp(-a * t)
        s = t * c
    elif b2 > 0.0:
        b = sqrt(b2)
        slow = exp(-w2 / (a + b) * t)
        fast = exp(-(a + b) * t)
        c = 0.5 * (slow + fast)
        s = 0.5 * (slow - fast) / b
    else:
        b = sqrt(-b2)
        decay = exp(-a * t)
        c = decay * cos(b * t)
        s = decay * sin(b * t) / b

    # Position and rate from both solutions
    return z * c + (r + a * z) * s, r * c - (a * r + w2 * z) * s


def fade_time(z, r, d, rest, a, w2):
    """Return when the rate has fallen to `rest` with the slow mode alone left, infinity if it does
    not end that way.

    The common end of an overdamped motion, in closed form; then rate = rest and z = -d rest/(slow
    eigenvalue).
    """
    b2 = a * a - w2
    if b2 <= 1e-12 * w2:
        return inf
    b = sqrt(b2)
    slow = w2 / (a + b)
    speed = -d * slow * (r + (a + b) * z) / (2.0 * b)
    if speed <= rest:
        return inf
    t = log(speed / rest) / slow
    # exp(-20) of the fast mode, in units of the rate `rest`, is far below any position that matters
    return t if 2.0 * b * t > 20.0 else inf


def stop_time(z, r, a, w2):
    """Return when the rate is next zero, infinity if never; from rest, when it is zero again."""
    # Critical damping
    b2 = a * a - w2
    pull = a * r + w2 * z
    if abs(b2) <= 1e-12 * w2:
        if r * pull > 0.0:
            return r / pull
        return inf

    # Overdamped: at most one zero
    if b2 > 0.0:
        b = sqrt(b2)
        if pull != 0.0:
            share = b * r / pull
        else:
            share = inf
        if 0.0 < share < 1.0:
            return 0.5 * log((1.0 + share) / (1.0 - share)) / b
        return inf

    # Underdamped: the first zero after the start
    b = sqrt(-b2)
    if pull != 0.0:
        angle = atan(b * r / pull)
    else:
        angle = 0.5 * pi
    if angle > 0.0:
        return angle / b
    return (angle + pi) / b


def fall_time(z, r, d, level, a, w2, T):
    """Return when the rate in direction `d`, at most `level` at time T, has fallen to `level`; 0 if
    never above it.
    """
    # The rate falls from its fastest moment on
    lo = 0.0
    pull = w2 * z + 2.0 * a * r
    if d * pull < 0.0:
        # still accelerating: the acceleration obeys the same equation, its zero is the fastest
        # moment
        lo = min(stop_time(r, -pull, a, w2), T)
    speed = d * free(z, r, a, w2, lo)[1]
    if speed <= level:
        return 0.0

    # A first guess from how fast it fades
    b2 = a * a - w2
    t = lo + log(speed / level) * ((a + sqrt(b2)) / w2 if b2 > 0.0 else 1.0 / a)
    hi = T
    if t >= hi:
        t = 0.5 * (lo + hi)

    # Newton's step within a bracket
    for _ in range(100):
        z1, r1 = free(z, r, a, w2, t)
        if d * r1 > level:
            lo = t
        else:
            hi = t
        t1 = hi
        if d * r1 > 0.0:
            # Newton on the logarithm of the rate, which falls along a straight line in the end
            t1 = t - log(d * r1 / level) * d * r1 / (-d * (w2 * z1 + 2.0 * a * r1))
        if not lo < t1 < hi:
            t1 = 0.5 * (lo + hi)
        if abs(t1 - t) <= 1e-12 * t or hi - lo <= 1e-12 * hi:
            break
        t = t1
    return t


def arrival_time(z, r, d, target, a, w2, T):
    """Return when z, past `target` in direction `d` at time T, arrives there (by bisection: end
    stops are rare).
    """
    lo = 0.0
    hi = T
    while hi - lo > 1e-12 * T:
        t = 0.5 * (lo + hi)
        if d * (free(z, r, a, w2, t)[0] - target) < 0.0:
            lo = t
        else:
            hi = t
    return hi


# --- Fixed sub-steps for any of the dry friction laws: slow and first-order, the obvious twin of
# the exact motion.


def slide_in_substeps(u, x, r, fs, fd, vs, a, w2, rest, T, substep):
    """Return (position in %, rate in %/s) after T s under OP `u` (%), in equal steps of at most
    `substep` s.

    Euler for the rate, its mean over the step for the position. A step that would reverse the
    motion, or end it at `rest` or slower, ends at rate zero; a valve at rate zero leaves only when
    |OP - position| > fs. Friction falls from fs to fd with speed over vs (%/s, Stribeck), at once
    for vs = 0. Each sub-step is taken, standing or not.
    """
    # Equal steps of at most `substep`
    n = ceil(T / substep - 1e-9)
    h = T / n

    # At rest the valve needs more than the static force
    for _ in range(n):
        if r == 0.0:
            if abs(u - x) <= fs:
                continue
            d = 1.0 if u > x else -1.0
        else:
            d = 1.0 if r > 0.0 else -1.0

        # The friction at this rate, and the step
        friction = fd
        if vs > 0.0:
            friction = fd + (fs - fd) * exp(-(r / vs) * (r / vs))
        r1 = r + h * (w2 * (u - x - d * friction) - 2.0 * a * r)

        # A rate below `rest` is none; travel has ends
        if d * r1 <= rest:
            r1 = 0.0
        x = min(max(x + 0.5 * h * (r + r1), 0.0), 100.0)
        r = r1
    return x, r


# --- One sample of an actuator with dry friction: exact by default, in fixed sub-steps when
# asked.


def move(u, state, S, J, p):
    """Return the state (v, rate) after one sample p.Ts under OP `u` (%), with the friction of a
    band S, J (%).

    `p` holds Fv, m, k, stroke, dv and substep as in actuator.py; v in %, rate in %/s.
    """
    x = min(max(u, 0.0), 100.0)
    fs = 0.5 * (S + J)
    fd = 0.5 * (S - J)
    a = 0.5 * p.Fv / p.m
    w2 = p.k / p.m
    rest = 100.0 * p.dv / p.stroke
    if p.substep > 0.0:
        return slide_in_substeps(x, state[0], state[1], fs, fd, 0.0, a, w2, rest, p.Ts, p.substep)
    return slide(x, state[0], state[1], fs, fd, a, w2, rest, p.Ts)

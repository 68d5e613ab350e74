"""The final control element: backlash, five friction models, dead-zone, and the slow stems of
pneumatic actuators.
"""

from __future__ import annotations

import math

import numpy as np

# what the compiled loop calls the friction in its valve
NO_FRICTION, DEADZONE, CHOUDHURY, _HE, _COULOMB, _KARNOPP, _STRIBECK = range(7)
FRICTION = {
    "choudhury": (
        CHOUDHURY,
        "Choudhury, Thornhill and Shah 2005: stops when OP reverses or stands",
    ),
    "he": (_HE, "He, Wang, Pottmann and Qin 2007: stops at every sample"),
    "coulomb": (
        _COULOMB,
        "spring, diaphragm, mass, viscous and dry friction, solved exactly between samples",
    ),
    "karnopp": (
        _KARNOPP,
        "the same stem, taken as stopped once it is slower than a limit (Karnopp 1985)",
    ),
    "stribeck": (
        _STRIBECK,
        "friction that falls with speed, in small steps along the pressure's ramp",
    ),
}
STATES = 3
_STEPS = 32  # of the pressure's ramp within one sample
_SLOW, _FAST = (
    0.10,
    0.03,
)  # time constants of the stem, in samples: an actuator is fast compared with its scan


def friction_numbers(S: float, J: float) -> np.ndarray:
    """Return what the friction models need: break-away and sliding friction in % of travel."""
    return np.array([(S + J) / 2.0, (S - J) / 2.0])


def play(u, v, width):
    """Backlash of a band `width`: v = max(u - width/2, min(u + width/2, v))."""
    return max(u - width / 2.0, min(u + width / 2.0, v))


def deadzone(u, width, centre):
    """MV = c + sign(u - c) max(|u - c| - D/2, 0)."""
    far = abs(u - centre) - width / 2.0
    if far <= 0.0:
        return centre
    return centre + far if u > centre else centre - far


def choudhury(u, state, fs, fd):
    """The two-parameter automaton (equations.md 1.5). State: position, direction of motion (0 =
    stuck), previous OP.
    """
    v, motion, before = state[0], state[1], state[2]
    if motion != 0.0 and (u - before) * motion <= 0.0:
        motion = 0.0
    if motion != 0.0:
        v = u - motion * fd
    elif u - v > fs:
        v, motion = u - fd, 1.0
    elif u - v < -fs:
        v, motion = u + fd, -1.0
    state[0], state[1], state[2] = v, motion, u
    return v


def he(u, state, fs, fd):
    """He's flow chart (equations.md 1.7) with its invariant: the residual is OP minus position."""
    pull = u - state[0]
    if pull > fs:
        state[0] = u - fd
    elif pull < -fs:
        state[0] = u + fd
    return state[0]


def coulomb(u, state, fs, fd, creep):
    """One sample of m x'' = u - x - friction, exact: each phase of motion is a sum of two
    exponentials (equations.md 1.8).

    State: position, speed (% per sample). At the sample's end a stem slower than `creep` counts as
    stopped.
    """
    x, v, left = state[0], state[1], 1.0
    l1, l2 = -1.0 / _SLOW, -1.0 / _FAST
    for _ in range(8):
        start = v == 0.0
        if start and abs(u - x) <= fs:
            break
        sign = math.copysign(1.0, u - x) if start else math.copysign(1.0, v)
        rest = u - sign * fd
        z = x - rest
        c1 = (v - l2 * z) / (l1 - l2)
        c2 = z - c1
        stop = left
        if not start and c1 != 0.0 and -c2 * l2 / (c1 * l1) > 0.0:
            t = math.log(-c2 * l2 / (c1 * l1)) / (l1 - l2)
            if 0.0 <= t < left:
                stop = t
        e1, e2 = math.exp(l1 * stop), math.exp(l2 * stop)
        x = rest + c1 * e1 + c2 * e2
        v = c1 * l1 * e1 + c2 * l2 * e2
        left -= stop
        if left <= 0.0:
            break
        v = 0.0
    if abs(v) <= creep:
        v = 0.0
    state[0], state[1] = x, v
    return x


def stribeck(u, state, fs, fd):
    """A stem under a pressure that ramps from the last OP to this one; friction fs - fd fades with
    speed (equations.md 1.8).

    State: position, speed (% per sample), previous OP.
    """
    x, v, before = state[0], state[1], state[2]
    h, damping, mass = 1.0 / _STEPS, _SLOW + _FAST, _SLOW * _FAST
    fade = max(0.05 * (fs - fd), 1e-9)  # Stribeck speed, % per sample: a twentieth of a jump
    for i in range(_STEPS):
        pull = before + (u - before) * (i + 1) * h - x
        if v == 0.0:
            if abs(pull) <= fs:
                continue
            sign = math.copysign(1.0, pull)
        else:
            sign = math.copysign(1.0, v)
        dry = fd + (fs - fd) * math.exp(-((v / fade) ** 2))
        v = (v + h / mass * (pull - sign * dry)) / (1.0 + h * damping / mass)
        if v * sign <= 0.0:
            v = 0.0
        x += h * v
    state[0], state[1], state[2] = x, v, u
    return x


def friction(kind, u, state, fs, fd):
    """Return the position after one sample of the friction model `kind`, whose memory is
    `state`.
    """
    if kind == CHOUDHURY:
        return choudhury(u, state, fs, fd)
    if kind == _HE:
        return he(u, state, fs, fd)
    if kind == _COULOMB:
        return coulomb(u, state, fs, fd, 0.0)
    if kind == _KARNOPP:
        return coulomb(u, state, fs, fd, 0.1 * (fs + fd))
    if kind == _STRIBECK:
        return stribeck(u, state, fs, fd)
    return u


def installed(u, R):
    """MV = 100 (R^(u/100) - 1)/(R - 1)."""
    if R == 1.0:
        return u
    return 100.0 * (R ** (u / 100.0) - 1.0) / (R - 1.0)


def opening(mv: float, R: float) -> float:
    """Return the OP at which a valve of ratio R passes `mv` (%): the inverse of its characteristic.

    >>> round(installed(opening(30.0, 20.0), 20.0), 9)
    30.0
    """
    if R == 1.0:
        return mv
    return 100.0 * math.log(1.0 + mv / 100.0 * (R - 1.0)) / math.log(R)

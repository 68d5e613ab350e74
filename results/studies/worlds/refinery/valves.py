"""The control valve in continuous time: friction of five kinds, backlash, dead-zone, stroke speed,
lag, stops, trim.

Two friction models are maps applied once per scan (`choudhury`, `he`), as fitted to plant data;
three are force balances of a spring-and-diaphragm actuator without inertia (`karnopp`, `stribeck`,
`lugre`), integrated on the fine grid. Forces are divided by spring stiffness times stroke, so that
everything is in % of travel: break-away fs = (S+J)/2, moving friction fd = (S-J)/2 (Choudhury,
Thornhill, Shah 2005, Control Eng. Practice 13, 641).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

FRICTION = ("none", "choudhury", "he", "karnopp", "stribeck", "lugre")
_NO_FRICTION, CHOUDHURY, HE, KARNOPP, STRIBECK, LUGRE = range(6)
# places in the state array; the direction of motion is 0 while stuck, the bristle is its deflection
_STEM, _DIRECTION, _LAST, _BRISTLE, _SPEED, _PLAY, _PLAY2, _SHAFT, _LAGGED = range(9)


class Valve(NamedTuple):
    """Numbers of the valve: % of travel and seconds; zeros (and R = 1, stops 0 and 100) make it
    ideal.
    """

    known_play: float = 0.0  # S of the baseline's dead-band
    play: float = 0.0
    zone: float = 0.0
    zone_centre: float = 50.0
    friction: int = _NO_FRICTION
    fs: float = 0.0
    fd: float = 0.0
    travel_time: float = 0.1  # viscous friction over spring stiffness, s
    stribeck_speed: float = 1.0  # % per s
    slip_end: float = 0.01  # distance to rest at which a moving stem counts as stopped, %
    bristle: float = 0.05  # pre-sliding travel, %
    speed: float = 0.0  # largest stroking speed, % per s; 0 = not limited
    lag: float = 0.0
    stop_lo: float = 0.0
    stop_hi: float = 100.0
    R: float = 1.0


def play(u, x, width):
    """Backlash: `x` follows `u` only beyond half the width (equations.md 1.2)."""
    return max(u - width / 2, min(u + width / 2, x))


def dead_zone(u, width, centre):
    """Rest at the centre inside the zone, memoryless (equations.md 1.3)."""
    d = u - centre
    if abs(d) <= width / 2:
        return centre
    return u - width / 2 if d > 0 else u + width / 2


def trim(x, R):
    """Inherent characteristic 100 (R^(x/100) - 1)/(R - 1)."""
    return x if R == 1.0 else 100.0 * (R ** (x / 100.0) - 1.0) / (R - 1.0)


def untrim(mv: float, R: float) -> float:
    """Return the travel (%) at which the characteristic gives `mv` (%)."""
    return mv if R == 1.0 else 100.0 * math.log1p(mv / 100.0 * (R - 1.0)) / math.log(R)


def choudhury(u, state, fs, fd):
    """Two-parameter model, one scan: stuck until |u - x| > fs, moving at offset fd until OP
    reverses or rests.
    """
    if state[_DIRECTION] != 0.0 and (u - state[_LAST]) * state[_DIRECTION] <= 0.0:
        state[_DIRECTION] = 0.0
    if state[_DIRECTION] != 0.0:
        state[_STEM] = u - state[_DIRECTION] * fd
    elif u - state[_STEM] > fs:
        state[_DIRECTION] = 1.0
        state[_STEM] = u - fd
    elif u - state[_STEM] < -fs:
        state[_DIRECTION] = -1.0
        state[_STEM] = u + fd
    state[_LAST] = u


def he(u, state, fs, fd):
    """He's model (He, Wang, Pottmann, Qin 2007), one scan: the stem sticks again after every
    scan.
    """
    residual = u - state[_STEM]
    if abs(residual) > fs:
        state[_STEM] = u - fd if residual > 0.0 else u + fd


def _stribeck_speed(push, v):
    """Speed at which viscous plus Stribeck friction balances the push, on the stable branch; 0
    where there is none.
    """
    x = (push - v.fd) / v.travel_time
    for _ in range(8):
        g = math.exp(-((x / v.stribeck_speed) ** 2)) * (v.fs - v.fd)
        slope = v.travel_time - g * 2.0 * x / v.stribeck_speed**2
        if slope <= 0.0:
            return 0.0
        step = (v.fd + g + v.travel_time * x - push) / slope
        x -= step
        if x <= 0.0:
            return 0.0
        if abs(step) < 1e-6 * x:
            break
    return x


def _slide(u, h, state, v):
    """Karnopp's or Stribeck's stem over one fine step: exact between break-away and stop (force
    held).
    """
    if state[_DIRECTION] == 0.0:
        if abs(u - state[_STEM]) <= v.fs:
            return
        state[_DIRECTION] = 1.0 if u > state[_STEM] else -1.0
    way = state[_DIRECTION]
    drag = v.fd
    if v.friction == STRIBECK:
        speed = _stribeck_speed(way * (u - state[_STEM]), v)
        if speed <= 0.0:
            state[_DIRECTION] = 0.0
            return
        drag += (v.fs - v.fd) * math.exp(-((speed / v.stribeck_speed) ** 2))
    left = way * (u - state[_STEM]) - drag
    if left <= v.slip_end:
        state[_DIRECTION] = 0.0
        return
    state[_STEM] += way * left * (1.0 - math.exp(-h / v.travel_time))


def _bristles(u, h, state, v):
    """LuGre (Canudas de Wit 1995) without inertia, implicit step: the speed solves one quadratic
    equation.

    Friction falls as exp(-|v|/vs) (Tustin 1947): with the square of v a slow stem would creep and
    never slip.
    """
    stiff = v.fs / v.bristle
    limit = (v.fd + (v.fs - v.fd) * math.exp(-abs(state[_SPEED]) / v.stribeck_speed)) / stiff
    z, damping = state[_BRISTLE], 0.2 * stiff * v.travel_time
    grip = stiff + damping / h
    pull = u - state[_STEM] + damping * z / h
    way = 1.0 if pull >= grip * z else -1.0
    z, pull = way * z, way * pull  # solved in the direction of motion
    viscous = v.travel_time + h
    a = viscous * h / limit
    b = grip * h + viscous - pull * h / limit
    c = grip * z - pull
    speed = (-b + math.sqrt(max(b * b - 4.0 * a * c, 0.0))) / (2.0 * a)
    state[_BRISTLE] = way * (z + h * speed) / (1.0 + h * speed / limit)
    state[_SPEED] = way * speed
    state[_STEM] += h * way * speed


def scan(op, state, v):
    """Once per scan: backlash, zone and the map-type frictions; returns what drives the stem until
    the next scan.
    """
    u = min(max(op, 0.0), 100.0)
    if v.known_play > 0.0:
        state[_PLAY] = play(u, state[_PLAY], v.known_play)
        u = state[_PLAY]
    if v.play > 0.0:
        state[_PLAY2] = play(u, state[_PLAY2], v.play)
        u = state[_PLAY2]
    if v.zone > 0.0:
        u = dead_zone(u, v.zone, v.zone_centre)
    if v.friction == CHOUDHURY:
        choudhury(u, state, v.fs, v.fd)
        u = state[_STEM]
    elif v.friction == HE:
        he(u, state, v.fs, v.fd)
        u = state[_STEM]
    return u


def stroke(u, h, keep, state, v):
    """One fine step of `h` s from drive `u` to the flow position MV (%); `keep` = exp(-h/lag)."""
    if v.friction >= KARNOPP:
        if v.friction == LUGRE:
            _bristles(u, h, state, v)
        else:
            _slide(u, h, state, v)
        u = state[_STEM]
    if v.speed > 0.0:
        move = v.speed * h
        u = state[_SHAFT] + min(max(u - state[_SHAFT], -move), move)
    u = min(max(u, v.stop_lo), v.stop_hi)
    if v.lag > 0.0:
        middle = u if v.speed == 0.0 and v.friction < KARNOPP else 0.5 * (u + state[_SHAFT])
        state[_LAGGED] = middle + (state[_LAGGED] - middle) * keep
    else:
        state[_LAGGED] = u
    state[_SHAFT] = u
    return trim(min(max(state[_LAGGED], 0.0), 100.0), v.R)


def rest(travel: float) -> np.ndarray:
    """Return the state of a valve at rest in mid-band at `travel` (%)."""
    state = np.zeros(9)
    state[[_STEM, _LAST, _PLAY, _PLAY2, _SHAFT, _LAGGED]] = travel
    return state

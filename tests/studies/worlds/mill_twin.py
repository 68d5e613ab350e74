"""Slow, obvious twins of the mill's compiled code: sums of step responses, controllers and valves
as prose would have them.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np


def step_response(
    t: float, kind: str, K: float, T: float | None, Td: float, lags: tuple[float, ...] = ()
) -> float:
    """PV at time t after the input has stepped by 1 at time 0, by partial fractions (distinct time
    constants).
    """
    s = t - Td
    if s <= 0.0:
        return 0.0
    if kind == "integrating":
        if not lags:
            return K * s
        (tau,) = lags
        return K * (s - tau * (1.0 - math.exp(-s / tau)))
    taus = [T, *lags]
    total = 1.0
    for i, a in enumerate(taus):
        weight = 1.0
        for j, b in enumerate(taus):
            if i != j:
                weight *= a / (a - b)
        total -= weight * math.exp(-s / a)
    return K * total


class SuperposedPlant:
    """PV as the sum of the step responses to all changes of the input so far."""

    def __init__(self, Ts, kind, K, T, Td, lags=()):
        self.Ts, self.model, self.inputs = Ts, (kind, K, T, Td, tuple(lags)), []

    def pv(self) -> float:
        k = len(self.inputs)
        changes = np.diff([0.0, *self.inputs])
        return sum(d * step_response((k - j) * self.Ts, *self.model) for j, d in enumerate(changes))

    def push(self, w: float) -> None:
        self.inputs.append(w)


class PlainController:
    """Each product's law as its manual would say it."""

    def __init__(self, family, rule, tuning, Ts, u0, limits=(0.0, 100.0), tracking=1.0):
        self.family, self.rule, self.Ts = family, rule, Ts
        self.Kc, self.Ti = tuning
        self.lo, self.hi = limits
        self.integral, self.last_e, self.last_u = u0, 0.0, u0
        self.track = None if self.Ti is None else min(1.0, Ts / (tracking * self.Ti))

    def area(self, e):
        return {"forward": self.last_e, "backward": e, "trapezoidal": (e + self.last_e) / 2}[
            self.rule
        ] * self.Ts

    def limit(self, u):
        return self.lo if u < self.lo else self.hi if u > self.hi else u

    def __call__(self, e):
        u = getattr(self, "_" + self.family)(e)
        self.last_e, self.last_u = e, u
        return u

    def _proportional(self, e):
        return self.limit(self.integral + self.Kc * e)

    def _velocity(self, e):
        du = self.Kc * (e - self.last_e + self.area(e) / self.Ti)
        return self.limit(self.last_u + du)

    def _conditional(self, e):
        grown = self.integral + self.Kc / self.Ti * self.area(e)
        wanted = self.Kc * e + grown
        outward = (wanted > self.hi and grown > self.integral) or (
            wanted < self.lo and grown < self.integral
        )
        if not outward:
            self.integral = grown
        return self.limit(self.Kc * e + self.integral)

    def _tracking(self, e):
        self.integral += self.Kc / self.Ti * self.area(e)
        wanted = self.Kc * e + self.integral
        self.integral -= self.track * (wanted - self.limit(wanted))
        return self.limit(wanted)

    def _clamped(self, e):
        self.integral = self.limit(self.integral + self.Kc / self.Ti * self.area(e))
        return self.limit(self.Kc * e + self.integral)


def kano(op, S, J):
    """Positions of a Kano valve (equations.md 1.6), which are those of Choudhury's on any input."""
    v = [op[0]]
    direction, stop, stuck, moved = 1.0, op[0] + (S - J) / 2, True, 0.0
    for before, u in pairwise(op):
        du = u - before
        if du * moved <= 0.0 and not stuck:
            stop, stuck = before, True
        if not stuck:
            v.append(u - direction * (S - J) / 2)
        elif -direction * (u - stop) > S:
            direction, stuck = -direction, False
            v.append(u - direction * (S - J) / 2)
        elif direction * (u - stop) > J:
            stuck = False
            v.append(u - direction * (S - J) / 2)
        else:
            v.append(v[-1])
        moved = du
    return np.array(v)


def he_flow_chart(op, S, J):
    """Positions by He's own flow chart, which accumulates OP's moves."""
    fs, fd = (S + J) / 2, (S - J) / 2
    v, residual = [op[0]], 0.0
    for before, u in pairwise(op):
        force = residual + u - before
        if abs(force) > fs:
            v.append(v[-1] + force - math.copysign(fd, force))
            residual = math.copysign(fd, force)
        else:
            v.append(v[-1])
            residual = force
    return np.array(v)


def sliding_stem(op, S, J, slow, fast, steps=20000):
    """Positions of a stem of mass and spring under dry friction, each sample in many small steps
    (Karnopp's stop rule).
    """
    fs, fd = (S + J) / 2, (S - J) / 2
    mass, damping, h = slow * fast, slow + fast, 1.0 / steps
    x, v, out = op[0], 0.0, []
    for u in op:
        for _ in range(steps):
            pull = u - x
            if v == 0.0 and abs(pull) <= fs:
                break
            sign = math.copysign(1.0, v if v != 0.0 else pull)
            new = v + h * (pull - sign * fd - damping * v) / mass
            v = 0.0 if new * sign < 0.0 else new
            x += h * v
        out.append(x)
    return np.array(out)

"""The compiled loop of the refinery against a slow twin in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

from results.studies.worlds.refinery import physics, valves
from results.studies.worlds.refinery.controller import Controller
from results.studies.worlds.refinery.physics import SUBSTEPS, Plant, Sensor, Signals
from results.studies.worlds.refinery.valves import Valve
from simbench.detectors.compiled import compiled

M0, PV0, TS = 50.0, 200.0, 2.0


def signals(n, seed=0, load=0.0, noise=0.0, sp=PV0, **changed):
    rng = np.random.default_rng(seed)
    nothing = np.zeros(n)
    base = {
        "sp": np.full(n, sp) if np.isscalar(sp) else sp,
        "load": load * np.cumsum(rng.standard_normal(n * SUBSTEPS)) / SUBSTEPS,
        "noise": noise * rng.standard_normal(n),
        "error": nothing,
        "spikes": nothing,
        "held": np.zeros(n, dtype=bool),
        "manual": np.zeros(n, dtype=bool),
        "hand": np.full(n, np.nan),
        "between": np.zeros(n, dtype=bool),
        "missed": np.zeros(n, dtype=int),
        "shift": nothing,
    }
    return Signals(**{**base, **changed})


def loop(x, plant=None, controller=None, valve=None, sensor=None):
    plant = plant or Plant(False, 2.0, 20.0, 5.0)
    controller = controller or Controller(Kc=1.0, Ti=20.0, Ts=TS, bias=M0)
    valve = valve or Valve()
    stem = valves.rest(valves.untrim(M0, valve.R))
    kernel = compiled(physics.close_loop)
    return kernel(plant, controller, valve, sensor or Sensor(), x, M0, PV0, stem)[:5]


class Twin:
    """The same loop in lists and loops: no ring buffers, no precomputed factors, the laws written
    out once more.
    """

    def __init__(self, plant, controller, valve, sensor):
        self.p, self.c, self.v, self.s = plant, controller, valve, sensor
        self.integral = self.e1 = self.u1 = None
        self.stem = valves.rest(M0)  # whose laws are tested by hand

    def law(self, sp, pv):
        c, e = self.c, sp - pv
        if abs(e) <= c.dead_width / 2:
            e = 0.0
        if self.u1 is None:
            self.e1, self.u1, self.integral = e, c.bias, -c.Kc * e
            self.sp0, self.f1, self.p1, self.d1 = sp, c.c * sp - pv, e, 0.0
        p, f = e - (1.0 - c.b) * (sp - self.sp0), c.c * sp - pv
        lag = c.Td / 8.0
        d = (lag * self.d1 + c.Kc * c.Td * (f - self.f1)) / (lag + c.Ts) if c.Td else 0.0
        mean = {0: e, 1: self.e1, 2: (e + self.e1) / 2}[c.rule]
        step = c.Kc * c.Ts / c.Ti * mean if c.Ti else 0.0
        clip = lambda u: min(max(u, c.lo), c.hi)  # noqa: E731
        if c.velocity:
            u = clip(self.u1 + c.Kc * (p - self.p1) + step + d - self.d1)
        elif not c.Ti:
            u = clip(c.bias + c.Kc * e)
        else:
            free = c.bias + c.Kc * p + d + self.integral + step
            if c.windup == 3:
                free -= step
                self.integral += c.Ts / c.Ti * (clip(free) - c.bias - self.integral)
            elif c.windup == 0:
                if c.lo <= free <= c.hi or (free > c.hi) != (step > 0):
                    self.integral += step
            elif c.windup == 1:
                self.integral += step + min(1.0, c.Ts / (c.Ti / 2)) * (clip(free) - free)
            else:
                self.integral = clip(c.bias + self.integral + step) - c.bias
            u = clip(free if c.windup in (1, 3) else c.bias + c.Kc * p + d + self.integral)
        self.e1, self.u1, self.p1, self.f1, self.d1 = e, u, p, f, d
        return round(u / c.quantum) * c.quantum if c.quantum else u

    def run(self, x):
        p, s, h = self.p, self.s, self.c.Ts / SUBSTEPS
        n, pv, op, mv, inputs = len(x.sp), [], [], [], []
        y = x.sp[0] - PV0
        lags, seen = [y, y, y], x.sp[0]
        shaft = M0
        for k in range(n):
            reading = seen
            if s.quantum:
                reading = round(reading / s.quantum) * s.quantum
            pv.append(reading + x.spikes[k])
            op.append(self.law(x.sp[k], pv[-1]))
            drive = valves.scan(op[-1], self.stem, self.v)
            for j in range(SUBSTEPS):
                shaft = drive + (shaft - drive) * math.exp(-h / self.v.lag) if self.v.lag else drive
                inputs.append(shaft + x.load[k * SUBSTEPS + j] - M0)
                back = len(inputs) - 1 - p.Td / h
                i = math.floor(back)
                at = lambda q: inputs[q] if q >= 0 else 0.0  # noqa: E731
                w = at(i) + (back - i) * (at(i + 1) - at(i)) if back > i else at(i)
                w += p.bend / 2 * w * w
                before = [y, *lags]
                y = (
                    y + p.K * h * w
                    if p.integrating
                    else p.K * w + (y - p.K * w) * math.exp(-h / p.T)
                )
                out, old = y, before[0]
                for q, tau in enumerate((p.lag1, p.lag2, p.extra_lag)):
                    mean = (out + old) / 2
                    lags[q] = mean + (before[q + 1] - mean) * math.exp(-h / tau) if tau else out
                    out, old = lags[q], before[q + 1]
                noise = x.noise[min(k + 1, n - 1)] + x.error[k]
                mean = PV0 + (out + old) / 2 + noise
                seen = mean + (seen - mean) * math.exp(-h / s.lag) if s.lag else PV0 + out + noise
            mv.append(shaft)
        return np.array(pv), np.array(op), np.array(mv)


CONTROLLERS = [
    {"Ti": 0.0},
    *[{"velocity": v, "rule": r} for v in (False, True) for r in (0, 1, 2)],
    *[{"windup": w, "rule": r, "lo": 45.0, "hi": 56.0} for w in (0, 1, 2) for r in (0, 2)],
    {"velocity": True, "lo": 45.0, "hi": 56.0},
    {"windup": 3, "rule": 1},
    {"windup": 3, "rule": 1, "lo": 45.0, "hi": 56.0},
    {"dead_width": 3.0},
    {"quantum": 0.7},
    *[{"Td": 4.0, "b": b, "c": c} for b, c in ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0))],
    {"Td": 4.0, "b": 0.5, "velocity": True},
]


@pytest.mark.parametrize("changed", CONTROLLERS, ids=str)
def test_every_controller_form_agrees_with_the_slow_twin(changed):
    c = Controller(**{"Kc": 0.9, "Ti": 25.0, "Ts": TS, "bias": M0, **changed})
    x = signals(400, load=3.0, noise=0.5, sp=np.where(np.arange(400) < 200, PV0, PV0 + 6))
    p = Plant(False, 2.0, 20.0, 5.0)
    fast, slow = loop(x, p, c), Twin(p, c, Valve(), Sensor()).run(x)
    for a, b in zip(fast, slow):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8)
    if "lo" in changed:
        assert np.isclose(fast[1].min(), 45) or np.isclose(fast[1].max(), 56), (
            "the limits were never met"
        )


PARTS = [
    (Plant(True, 0.05, 1.0, 3.3), Valve(), Sensor()),
    (Plant(False, 2.0, 20.0, 0.0, lag1=2.0, lag2=1.0), Valve(), Sensor()),
    (Plant(False, 2.0, 20.0, 7.7, extra_lag=9.0), Valve(), Sensor(lag=4.0)),
    (Plant(False, 2.0, 20.0, 5.0), Valve(play=2.0), Sensor(quantum=0.8)),
    (Plant(False, 2.0, 20.0, 5.0), Valve(zone=3.0, zone_centre=51.0), Sensor()),
    (Plant(False, 2.0, 20.0, 5.0, bend=0.03), Valve(lag=6.0), Sensor()),
    (Plant(False, 2.0, 20.0, 5.0), Valve(friction=valves.CHOUDHURY, fs=2.0, fd=1.0), Sensor()),
    (Plant(True, 0.05, 1.0, 3.3), Valve(friction=valves.HE, fs=1.5, fd=0.5), Sensor()),
]


@pytest.mark.parametrize("parts", PARTS, ids=range(len(PARTS)))
def test_every_part_of_the_plant_agrees_with_the_slow_twin(parts):
    p, v, s = parts
    c = Controller(Kc=0.9, Ti=25.0, Ts=TS, bias=M0)
    x = signals(300, load=3.0, noise=0.5)
    for a, b in zip(loop(x, p, c, v, s), Twin(p, c, v, s).run(x)):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8)


def test_external_reset_is_a_pi_of_the_forward_rule_between_its_limits():
    x, c = signals(300, load=2.0, noise=0.3), Controller(Kc=0.5, Ti=30.0, Ts=TS, bias=M0, rule=1)
    plain, reset = (loop(x, controller=c._replace(windup=w))[1] for w in (0, 3))
    np.testing.assert_allclose(np.diff(reset)[5:], np.diff(plain)[5:], atol=1e-9)

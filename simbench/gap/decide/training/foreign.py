"""Kinds of gap that no effect id covers, on which the diagnosis learns to say "unknown"; one compact loop runs them all."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from scipy.signal import lfilter

from detectors.record import LoopRecord
from simbench.gap.decide.training.sizes import Scales
from simbench.gap.effects._draw import between
from simbench.loop.plant import sample
from simbench.loop.setup import Setup

# What the loop does differently; each value here does nothing.
KNOBS: dict[str, float] = {
    "asymmetry": 1.0,  # gain on negative errors over that on positive ones
    "square": 0.0,  # 0..1 of the gain grows with |error| / e0
    "e0": 1.0,  # PV units
    "derivative": 0.0,  # % per PV unit and sample, on PV through a filter of four samples
    "override": 1e9,  # OP (%) is cut here by another controller, and the integral is not told
    "opening": 1e9,  # largest speed of the valve, % per sample
    "closing": 1e9,
    "lattice": 0.0,  # travel in steps of so many %
    "recycle": 0.0,  # share of PV that comes back at the plant's input
    "loop_time": 1.0,  # samples that takes
    "gain": 1.0,  # PV units per %, what `recycle` and `flow0` refer to
    "flow0": 0.0,  # flow (%) at op0 through the pipe that makes the dead time; 0 = constant dead time
    "root": 0.0,  # PV units over which a sensor bends as a square root does; 0 = straight
    "backlash": 0.0,  # play in the sensor, PV units
}
Knobs = namedtuple("Knobs", list(KNOBS))


@njit(cache=True)
def foreign_loop(sp, load, noise, op_held, mv_held, pv_held, strength, A, B_old, B_new, C, delay, control, knobs, op, pv, mv):
    """Run the loop sample by sample; `control` is (Kc with sign, Kc Ts/Ti or 0, op0, pv0); fills `op`, `pv`, `mv`.

    `strength` multiplies what the plant answers to MV; the held arrays tell where a signal stands still.
    """
    Kc, Ki, op0, pv0 = control
    k_ = Knobs(*knobs)
    m, n = A.shape[0], sp.size
    x, new = np.zeros(m), np.zeros(m)
    w, y = np.zeros(n), np.zeros(n)
    u, v, f_old, slow, seen = op0, op0, 0.0, pv0, pv0
    for k in range(n):
        y[k] = pv0
        for i in range(m):
            y[k] += C[i] * x[i]
        half = 0.5 * k_.backlash
        seen = max(y[k] - half, min(y[k] + half, seen))
        d = seen - pv0
        if k_.root > 0.0:
            d = 2.0 * k_.root * (np.sqrt(max(1.0 + d / k_.root, 0.01)) - 1.0)
        pv[k] = pv[k - 1] if pv_held[k] and k > 0 else pv0 + d + noise[k]
        e = sp[k] - pv[k]
        f = e * (1.0 + k_.square * (abs(e) / k_.e0 - 1.0)) * (k_.asymmetry if e < 0.0 else 1.0)
        slope = 0.25 * (pv[k] - slow)
        slow += slope
        u = min(max(u + Kc * (f - f_old) + Ki * f if Ki != 0.0 else op0 + Kc * f, 0.0), 100.0)
        f_old = f
        if op_held[k] and k > 0:
            u = op[k - 1]
        op[k] = min(min(max(u - k_.derivative * slope, 0.0), 100.0) if not op_held[k] else u, k_.override)
        if not mv_held[k]:
            target = op[k]
            if k_.lattice > 0.0:
                target = k_.lattice * np.round(target / k_.lattice)
            v = min(max(target, v - k_.closing), v + k_.opening)
        mv[k] = v
        w[k] = strength[k] * (v - op0) + load[k]
        back = int(k_.loop_time)
        if k >= back:
            w[k] += k_.recycle * (y[k - back] - pv0) / k_.gain
        if k_.flow0 > 0.0:  # a slow flow takes long through the pipe
            at = max(k - delay * k_.flow0 / max(k_.flow0 + v - op0, 0.25 * k_.flow0), 0.0)
            j = int(at)
            old = now = w[j] + (at - j) * ((w[j + 1] if j < k else w[j]) - w[j])
        else:
            old = w[k - delay - 1] if k > delay else 0.0
            now = w[k - delay] if k >= delay else 0.0
        for i in range(m):
            new[i] = B_old[i] * old + B_new[i] * now
            for j in range(m):
                new[i] += A[i, j] * x[j]
        for i in range(m):
            x[i] = new[i]


@dataclass(eq=False)
class Oddity:
    """A loop open to what no effect does: its setup, what is held still, and the knobs."""

    setup: Setup
    scales: Scales
    sp: np.ndarray = field(init=False)
    op_held: np.ndarray = field(init=False)
    mv_held: np.ndarray = field(init=False)
    pv_held: np.ndarray = field(init=False)
    strength: np.ndarray = field(init=False)
    knobs: dict[str, float] = field(default_factory=lambda: dict(KNOBS))

    def __post_init__(self) -> None:
        """Begin with a loop in which nothing is odd."""
        n = self.setup.sp.size
        self.sp, self.strength = self.setup.sp.copy(), np.ones(n)
        self.op_held, self.mv_held, self.pv_held = (np.zeros(n, dtype=bool) for _ in range(3))

    @property
    def warm(self) -> int:
        """Samples before the record."""
        return self.scales.bench.warm

    def run(self) -> LoopRecord:
        """Return what the archive shows."""
        setup, n = self.setup, self.sp.size
        plant = sample(setup.num, setup.den, setup.Td, setup.Ts)
        gain = setup.sign * setup.Kc
        control = (gain, gain * setup.Ts / setup.Ti if setup.Ti is not None else 0.0, setup.op0, setup.pv0)
        op, pv, mv = np.empty(n), np.empty(n), np.empty(n)
        foreign_loop(
            self.sp, setup.load_in, setup.pv_add, self.op_held, self.mv_held, self.pv_held, self.strength,
            plant.A, plant.B_old, plant.B_new, plant.C, plant.delay, control, tuple(self.knobs.values()), op, pv, mv,
        )  # fmt: skip
        return self.scales.bench.archive(op, pv, mv)


@dataclass(frozen=True)
class Kind:
    """A foreign kind: its block, what it needs of the loop, and how it is put into one at size x in 0..1.

    `put(oddity, x, rng)` returns the numbers that describe it.
    """

    block: str
    put: Callable[[Oddity, float, np.random.Generator], dict[str, float]]
    steps: bool = False
    foptd: bool = False


def _knobs(**sizes: Callable[[Scales, float], float]) -> Callable[[Oddity, float, np.random.Generator], dict[str, float]]:
    def put(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
        values = {name: float(size(o.scales, x)) for name, size in sizes.items()}
        o.knobs.update(values)
        return values

    return put


def _spells(rng: np.random.Generator, n: int, share: float, mean: float) -> np.ndarray:
    # about so much of the time in spells of this mean length; their order does not change with the share
    starts, lengths = rng.integers(0, n, 64), rng.uniform(0.5, 1.5, 64) * mean
    held = np.zeros(n, dtype=bool)
    for start, length in zip(starts, lengths):
        if held.mean() >= share:
            break
        held[start : start + int(length) + 1] = True
    return held


def _held(signal: str, low: float, high: float) -> Callable[[Oddity, float, np.random.Generator], dict[str, float]]:
    def put(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
        paces = float(rng.uniform(1.0, 6.0)) * (0.3 if signal == "pv_held" else 1.0)
        share = between(x, low, high)
        mean = min(paces * o.scales.bench.pace / o.setup.Ts, 0.3 * o.sp.size) * between(x, 0.3, 1.5)
        getattr(o, signal)[o.warm :] = _spells(rng, o.sp.size - o.warm, share, mean)
        return {"share": share, "mean_length": mean * o.setup.Ts}

    return put


def _sp_filter(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    tau = between(x, 0.1, 20.0) * o.scales.bench.pace
    a = np.exp(-o.setup.Ts / tau)
    o.sp = np.asarray(lfilter([1 - a], [1, -a], o.sp - o.sp[0])) + o.sp[0]
    return {"tau": float(tau)}


def _sp_ramp(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    samples = between(x, 0.3, 40.0) * o.scales.bench.pace / o.setup.Ts  # for the largest step
    rate = float(np.abs(np.diff(o.setup.sp[o.warm :])).max()) / samples
    wanted, now = o.setup.sp[o.warm :].tolist(), float(o.setup.sp[o.warm])
    for k, goal in enumerate(wanted):
        now += min(max(goal - now, -rate), rate)
        o.sp[o.warm + k] = now
    return {"rate": rate / o.setup.Ts}


def _override(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    o.knobs["override"] = float(np.quantile(o.scales.record.op, 1 - between(x, 0.002, 0.45)))
    return {"limit": o.knobs["override"]}


def _asymmetric_gain(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    o.knobs["asymmetry"] = between(x, 1.1, 6.0) ** float(rng.choice([-1, 1]))
    return {"asymmetry": o.knobs["asymmetry"]}


def _gain_jump(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    at = o.warm + int((o.sp.size - o.warm) * rng.uniform(0.25, 0.75))
    factor = between(x, 1.1, 6.0) ** float(rng.choice([-1, 1]))
    o.strength[at:] = factor
    return {"factor": factor, "at": (at - o.warm) * o.setup.Ts}


def _underdamped(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    damping = between(x, 0.8, 0.04)
    period = o.scales.bench.scale * float(rng.uniform(1.0, 4.0)) / (2 * np.pi) * between(x, 0.3, 1.0)
    fast = [period**2, 2 * damping * period, 1.0]
    # the resonance takes the place of the time constant, or sits on top of the integrator
    o.setup.den = np.polymul([1.0, 0.0], fast) if o.setup.den[-1] == 0 else np.array(fast)
    return {"damping": damping, "period": 2 * np.pi * period}


def _inverse_response(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    zero = between(x, 0.1, 5.0) * o.scales.lag
    o.setup.num = np.polymul(o.setup.num, [-zero, 1.0])
    o.setup.den = np.polymul(o.setup.den, [0.5 * zero, 1.0])
    return {"zero": zero}


def _recycle(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    wait = float(rng.uniform(1.0, 6.0)) * o.scales.lag
    o.knobs.update(recycle=between(x, 0.05, 0.9), loop_time=round(wait / o.setup.Ts), gain=float(o.setup.num[0]))
    return {"share": o.knobs["recycle"], "delay": wait}


def _recalibration(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    s = o.scales
    at = o.warm + int((o.sp.size - o.warm) * rng.uniform(0.15, 0.85))
    jump = between(x, 2.0, 200.0) * s.pv * float(rng.choice([-1, 1]))
    o.setup.pv_add[at:] += jump
    return {"jump": jump, "at": (at - o.warm) * o.setup.Ts}


def _spike_train(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    # a cleaning pulse: at nearly even intervals PV jumps one way and decays
    interval, decay = rng.uniform(20, 120), rng.uniform(1.5, 6.0)
    hits = np.cumsum(rng.uniform(0.8, 1.2, int(o.sp.size / interval) + 1) * interval).astype(int)
    pulses = np.zeros(o.sp.size)
    pulses[hits[hits < o.sp.size]] = between(x, 1.0, 40.0) * o.scales.pv * float(rng.choice([-1, 1]))
    o.setup.pv_add += np.asarray(lfilter([1.0], [1.0, -np.exp(-1 / decay)], pulses))
    return {"height": float(np.abs(pulses).max()), "interval": interval * o.setup.Ts, "decay": decay * o.setup.Ts}


def _load_bursts(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    # another loop is switched on and off: for spells the load is rough
    mean = o.sp.size * float(rng.uniform(0.02, 0.1))
    on = _spells(rng, o.sp.size, float(rng.uniform(0.1, 0.4)), mean)
    factor = between(x, 1.5, 40.0)
    a = np.exp(-o.setup.Ts / (o.scales.bench.pace * rng.uniform(0.1, 1.0)))
    rough = np.asarray(lfilter([np.sqrt(1 - a**2)], [1, -a], rng.standard_normal(o.sp.size)))
    size = min(factor * 0.3 * max(float(o.setup.load_in.std()), 0.2), 25.0)
    o.setup.load_in += on * size * rough
    return {"size": size, "mean_length": mean * o.setup.Ts}


def _load_pulses(o: Oddity, x: float, rng: np.random.Generator) -> dict[str, float]:
    # batches: the load rises at once and dies away, always the same way, at nearly even intervals
    decay = o.scales.bench.pace * float(rng.uniform(0.5, 3.0)) / o.setup.Ts
    interval = max(decay * float(rng.uniform(3.0, 8.0)), 20.0)
    hits = np.cumsum(rng.uniform(0.8, 1.2, int(o.sp.size / interval) + 1) * interval).astype(int)
    pulses = np.zeros(o.sp.size)
    height = min(between(x, 0.5, 20.0) * o.scales.op, 30.0) * float(rng.choice([-1, 1]))
    pulses[hits[hits < o.sp.size]] = height
    o.setup.load_in += np.asarray(lfilter([1.0], [1.0, -np.exp(-1 / decay)], pulses))
    return {"height": height, "interval": interval * o.setup.Ts, "decay": decay * o.setup.Ts}


FOREIGN: dict[str, Kind] = {
    "manual_spells": Kind("controller", _held("op_held", 0.02, 0.6)),
    "sp_filter": Kind("controller", _sp_filter, steps=True),
    "sp_ramp": Kind("controller", _sp_ramp, steps=True),
    "error_squared": Kind("controller", _knobs(square=lambda s, x: between(x, 0.05, 1.0), e0=lambda s, x: 2 * s.pv)),
    "asymmetric_gain": Kind("controller", _asymmetric_gain),
    "derivative_action": Kind(
        "controller",
        _knobs(derivative=lambda s, x: s.bench.loop.controller.sign * s.bench.loop.controller.Kc * between(x, 0.2, 8.0)),
    ),
    "hidden_override": Kind("controller", _override),
    "slow_opening": Kind("valve", _knobs(opening=lambda s, x: between(x, 4.0, 0.02) * s.op_change)),
    "travel_steps": Kind("valve", _knobs(lattice=lambda s, x: between(x, 0.3, 12.0) * s.op)),
    "seized_spells": Kind("valve", _held("mv_held", 0.02, 0.6)),
    "gain_jump": Kind("process", _gain_jump),
    "underdamped": Kind("process", _underdamped),
    "inverse_response": Kind("process", _inverse_response),
    "recycle": Kind("process", _recycle, foptd=True),
    "flow_dead_time": Kind("process", _knobs(flow0=lambda s, x: between(x, 30.0, 1.0) * s.op), steps=True),
    "root_sensor": Kind("sensor", _knobs(root=lambda s, x: between(x, 40.0, 0.6) * float(np.ptp(s.record.pv)) / 2), steps=True),
    "sensor_backlash": Kind("sensor", _knobs(backlash=lambda s, x: between(x, 0.3, 20.0) * s.pv)),
    "recalibration": Kind("sensor", _recalibration),
    "frozen_spells": Kind("sensor", _held("pv_held", 0.005, 0.4)),
    "spike_train": Kind("sensor", _spike_train),
    "load_bursts": Kind("disturbance", _load_bursts),
    "load_pulses": Kind("disturbance", _load_pulses),
}


def run_foreign(kind: str, setup: Setup, scales: Scales, x: float, rng: Any) -> tuple[LoopRecord, dict[str, float]]:
    """Return the record of a finished setup with a foreign kind of size x in it, and the numbers that describe the kind."""
    oddity = Oddity(setup, scales)
    described = FOREIGN[kind].put(oddity, x, rng)
    return oddity.run(), described

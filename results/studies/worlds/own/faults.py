"""Apply each effect, including kinds that the diagnosis does not know, to a loop of this
simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from results.studies.worlds.own import simulator as sim
from results.studies.worlds.own.loops import Fault, Prepared
from simbench.detectors.compiled import njit_cached

Parameters = dict[str, float | str]


def fault(name: str, p: Parameters) -> Fault:
    """Return the fault as a function that changes a prepared run."""
    return partial(_ACT[name], p=p)


# ------------------------------------------------------------------------------------------------
# the 22 effects
def _stiction(s: Prepared, rng, p) -> None:
    S, J = p["S"], min(p["J"], p["S"])
    if S > 0:
        fs, fc = (S + J) / 2, (S - J) / 2
        s.physics |= {"friction": s.case.friction, "fs": fs, "fc": fc}


def _deadband(s: Prepared, rng, p) -> None:
    if p["S"] > 0:
        s.physics |= {"friction": sim.PLAY, "fc": p["S"] / 2}


def _deadzone(s: Prepared, rng, p) -> None:
    s.physics |= {"deadzone": p["D"], "deadzone_centre": p.get("c", s.case.op0)}


def _valve_characteristic(s: Prepared, rng, p) -> None:
    R = p["R"]
    s.physics["R"] = R
    if R != 1.0:  # the operator's bias puts MV where it was
        s.physics["bias"] = 100.0 * math.log1p(s.case.op0 / 100.0 * (R - 1.0)) / math.log(R)


def _mismatch(name: str, s: Prepared, rng, p) -> None:
    s.physics[name] *= p["factor"]


def _dead_time_mismatch(s: Prepared, rng, p) -> None:
    s.physics["Td"] = max(s.physics["Td"] + p["extra"], 0.0)


def _noise(s: Prepared, rng, p) -> None:
    s.noise = p["factor"] * s.noise + p.get("std", 0.0) * rng.standard_normal(s.size)


def _quantisation(s: Prepared, rng, p) -> None:
    if p.get("at", "loop") == "loop":
        s.physics["pv_step"] = p["step"]
    elif p["step"] > 0:
        s.archive.append(lambda pv: p["step"] * np.floor(pv / p["step"] + 0.5))


def _compression(s: Prepared, rng, p) -> None:
    if p["band"] > 0:
        s.archive.append(lambda pv: swinging_door(pv, p["band"]))


def _outliers(s: Prepared, rng, p) -> None:
    hit = rng.random(s.size) < p["rate"]
    spikes = hit * p["size"] * rng.uniform(0.6, 1.4, s.size) * rng.choice([-1.0, 1.0], s.size)
    if p.get("at", "record") == "loop":
        s.noise = s.noise + spikes
    else:
        s.archive.append(lambda pv: pv + spikes[s.start :])


def _slow(s: Prepared, rng, p) -> np.ndarray:
    """Ramp plus random walk from the record's start on."""
    t = np.maximum(np.arange(s.size) - s.start, 0) * s.case.Ts
    steps = rng.standard_normal(s.size) * (t > 0)
    return p["rate"] * t + p["walk"] * math.sqrt(s.case.Ts) * np.cumsum(steps)


def _drift(s: Prepared, rng, p) -> None:
    s.sensor = s.sensor + _slow(s, rng, p)


def _load_drift(s: Prepared, rng, p) -> None:
    s.load = s.load + _slow(s, rng, p)


def _oscillation(s: Prepared, rng, p) -> None:
    phase = rng.uniform(0, 2 * math.pi)
    s.load = s.load + p["amplitude"] * np.sin(
        2 * math.pi * np.arange(s.size) * s.case.Ts / p["period"] + phase
    )


def _load_steps(s: Prepared, rng, p) -> None:
    jumps = rng.random(s.size) < p["rate"] * s.case.Ts
    levels = rng.standard_normal(s.size) * p["size"]
    jumps[0] = True
    s.load = s.load + levels[jumps][np.cumsum(jumps) - 1]


def _saturation(s: Prepared, rng, p) -> None:
    s.physics |= {"lo": p["lo"], "hi": p["hi"]}


def _detuning(s: Prepared, rng, p) -> None:
    s.physics["Kc"] *= p["Kc_factor"]
    s.physics["Ti"] *= p["Ti_factor"]


def _error_deadband(s: Prepared, rng, p) -> None:
    s.physics |= {"error_deadband": p["width"], "error_gap_is_smooth": float(s.case.smooth_gap)}


def _set(name: str, key: str, s: Prepared, rng, p) -> None:
    s.physics[name] = p[key]


# ------------------------------------------------------------------------------------------------
# foreign kinds
def _spells(s: Prepared, rng, every: float, length: float) -> np.ndarray:
    """Random stretches (0/1), one per `every` samples on average, `length` samples long on
    average.
    """
    on, k = np.zeros(s.size), 0
    while k < s.size:
        k += 1 + int(rng.exponential(every))
        long = 1 + int(rng.exponential(length))
        on[k : k + long] = 1.0
        k += long
    return on


def _positioner_cycle(s: Prepared, rng, p) -> None:
    """The positioner hunts: a square-like motion of MV that OP does not ask for, its period
    wandering.
    """
    rate = 2 * math.pi * s.case.Ts / p["period"] * np.exp(0.25 * rng.standard_normal(s.size))
    s.valve_add = s.valve_add + p["amplitude"] * np.tanh(4.0 * np.sin(np.cumsum(rate)))


def _frozen_sensor(s: Prepared, rng, p) -> None:
    s.hold = (
        np.maximum(s.hold, _spells(s, rng, p["every"], p["length"])) if p["length"] > 0 else s.hold
    )


def _bias_switching(s: Prepared, rng, p) -> None:
    s.sensor = s.sensor + p["size"] * _spells(s, rng, p["every"], p["every"])


def _noise_bursts(s: Prepared, rng, p) -> None:
    s.noise = s.noise * (1.0 + (p["factor"] - 1.0) * _spells(s, rng, p["every"], 0.25 * p["every"]))


def _missed_scans(s: Prepared, rng, p) -> None:
    s.skip = np.maximum(s.skip, (rng.random(s.size) < p["share"]).astype(float))


def _feedforward(s: Prepared, rng, p) -> None:
    """Another signal is added to OP after the controller, as a feed-forward or a decoupler
    does.
    """
    tau = max(2.0, s.case.speed / s.case.Ts)
    wander = np.cumsum((_spells(s, rng, tau, 1.0) > 0) * rng.standard_normal(s.size))
    width = min(int(20 * tau), wander.size)  # a short test of a slow loop
    wander = wander - np.convolve(wander, np.ones(width) / width, "same")
    s.op_add = s.op_add + p["size"] * wander / max(wander.std(), 1e-9)


def _varying_gain(s: Prepared, rng, p) -> None:
    t = np.arange(s.size) - s.start
    s.gain = s.gain * np.exp(
        p["log_range"] * np.sin(2 * math.pi * t / (0.7 * s.case.n) + rng.uniform(0, 6.28))
    )


def _valve_sleeps(s: Prepared, rng, p) -> None:
    """Air fails now and then: the valve does not answer for a while, then catches up."""
    if p["length"] > 0:
        s.asleep = np.maximum(s.asleep, _spells(s, rng, p["every"], p["length"]))


_ACT: dict[str, Callable] = {
    "stiction": _stiction,
    "deadband": _deadband,
    "deadzone": _deadzone,
    "valve_lag": partial(_set, "valve_lag", "tau"),
    "valve_characteristic": _valve_characteristic,
    "gain_mismatch": partial(_mismatch, "K"),
    "time_constant_mismatch": partial(_mismatch, "T"),
    "dead_time_mismatch": _dead_time_mismatch,
    "extra_lag": partial(_set, "extra_lag", "tau"),
    "noise": _noise,
    "quantisation": _quantisation,
    "sensor_lag": partial(_set, "sensor_lag", "tau"),
    "compression": _compression,
    "outliers": _outliers,
    "drift": _drift,
    "oscillation": _oscillation,
    "load_steps": _load_steps,
    "load_drift": _load_drift,
    "saturation": _saturation,
    "detuning": _detuning,
    "error_deadband": _error_deadband,
    "op_quantisation": partial(_set, "op_step", "step"),
    # foreign
    "positioner_cycle": _positioner_cycle,
    "frozen_sensor": _frozen_sensor,
    "bias_switching": _bias_switching,
    "noise_bursts": _noise_bursts,
    "missed_scans": _missed_scans,
    "feedforward": _feedforward,
    "varying_gain": _varying_gain,
    "valve_sleeps": _valve_sleeps,
    "slew_limit": partial(_set, "slew", "slew"),
    "level_gain": partial(_set, "level_gain", "slope"),
    "inverse_response": partial(_set, "inverse", "tau"),
    "derivative": partial(_set, "derivative", "Td"),
    "sp_weight": partial(_set, "sp_weight", "b"),
}

FOREIGN: dict[str, str] = {
    "positioner_cycle": "valve",
    "valve_sleeps": "valve",
    "slew_limit": "valve",
    "level_gain": "process",
    "inverse_response": "process",
    "varying_gain": "process",
    "frozen_sensor": "sensor",
    "bias_switching": "sensor",
    "noise_bursts": "sensor",
    "missed_scans": "controller",
    "feedforward": "controller",
    "derivative": "controller",
    "sp_weight": "controller",
}
"""Foreign kinds and the block in which each lies."""
KNOWN = tuple(name for name in _ACT if name not in FOREIGN)

NEEDS_SP_STEPS = frozenset({"sp_weight", "level_gain"})
NEEDS_PLANT = {"time_constant_mismatch": "foptd", "level_gain": "integrating"}
"""A gain that follows PV is a valve characteristic on a plant whose PV follows OP.

On a vessel it is its shape.
"""


@njit_cached
def swinging_door(x: np.ndarray, band: float) -> np.ndarray:
    """Thin a signal by the swinging door (Bristol 1990) and rebuild it by straight lines; the error
    stays within `band`.
    """
    out = x.copy()
    start, steep, flat = 0, np.inf, -np.inf
    for k in range(1, x.size):
        slope = (x[k] - x[start]) / (k - start)
        # the line to this point would leave the door of an earlier one
        if slope > steep or slope < flat:
            _draw(out, start, k - 1)
            start, steep, flat = k - 1, np.inf, -np.inf
        steep = min(steep, (x[k] + band - x[start]) / (k - start))
        flat = max(flat, (x[k] - band - x[start]) / (k - start))
    _draw(out, start, x.size - 1)
    return out


@njit_cached
def _draw(x, a, b):
    for i in range(a + 1, b):
        x[i] = x[a] + (x[b] - x[a]) * (i - a) / (b - a)

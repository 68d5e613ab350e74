"""Choose a plausible strength of each fault in a given loop, from 0 (barely visible) to 1
(gross).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from results.studies.worlds.own.faults import Parameters
from results.studies.worlds.own.loops import TrueLoop

_Scale = Callable[[float], Parameters]


@dataclass(frozen=True)
class Habit:
    """What the faultless loop does by itself: the yardstick for sizes of faults."""

    op_lo: float
    op_hi: float
    op_std: float
    e_std: float


def scale(name: str, case: TrueLoop, habit: Habit, rng: np.random.Generator) -> _Scale:
    """Return the parameters of a fault as a function of one strength in 0..1, from barely to
    grossly present.
    """

    def log(lo: float, hi: float) -> Callable[[float], float]:
        return lambda x: float(f"{lo * (hi / lo) ** x:.4g}")

    def one(key: str, lo: float, hi: float, **fixed: float) -> _Scale:
        size = log(lo, hi)
        return lambda x: {key: size(x), **fixed}

    way = float(rng.choice([-1.0, 1.0]))
    u = rng.random(4).tolist()
    noise, e = case.noise_std, max(habit.e_std, case.noise_std)
    pace = max(case.speed / 2, 2 * case.Ts)
    match name:
        case "stiction":
            size, ratio = log(0.15, 20), 0.15 + 0.85 * u[0]
            return lambda x: {"S": size(x), "J": float(f"{ratio * size(x):.4g}")}
        case "deadband":
            return one("S", 0.15, 25)
        case "deadzone":
            return one("D", 0.15, 30, c=round(case.op0 + (u[0] - 0.5) * habit.op_std, 3))
        case "valve_lag" | "extra_lag" | "sensor_lag":
            return one("tau", max(0.7 * case.Ts, 0.1 * pace), 4 * pace)
        case "valve_characteristic":
            size = log(0.4, 3.9)
            return lambda x: {"R": float(f"{math.exp(way * size(x)):.4g}")}
        case "gain_mismatch" | "time_constant_mismatch":
            size = log(0.18, 1.5)
            return lambda x: {"factor": float(f"{math.exp(way * size(x)):.4g}")}
        case "dead_time_mismatch":
            least = max(case.Ts, 0.25 * case.Td)
            shorter = way < 0 and case.Td >= 4 * case.Ts and not case.log_is_late
            size = log(least, case.Td) if shorter else log(least, 3 * case.speed)
            return lambda x: {"extra": -size(x) if shorter else size(x)}
        case "noise":
            return (
                one("factor", 0.75, 0.1, std=0.0)
                if u[0] < 0.2
                else one("factor", 1.25, 15, std=0.0)
            )
        case "quantisation":
            size, at = log(0.4 * noise, max(20 * noise, 2 * e)), "loop" if u[0] < 0.6 else "record"
            return lambda x: {"step": size(x), "at": at}
        case "compression":
            return one("band", 0.5 * noise, max(15 * noise, 2 * e))
        case "outliers":
            size, rate, at = (
                log(4 * noise, max(100 * noise, 20 * e)),
                round(0.003 + 0.02 * u[0], 4),
                "record" if u[1] < 0.5 else "loop",
            )
            return lambda x: {"rate": rate, "size": size(x), "at": at}
        case "drift" | "load_drift":
            per = case.unit if name == "drift" else 1.0
            total, ramp = log(0.5 * per, 35 * per), u[0] < 0.5
            if ramp:
                return lambda x: {
                    "rate": way * float(f"{total(x) / case.duration:.4g}"),
                    "walk": 0.0,
                }
            return lambda x: {
                "rate": 0.0,
                "walk": float(f"{total(x) / math.sqrt(case.duration):.4g}"),
            }
        case "oscillation":
            # fewer periods would be a wandering load
            period = min(case.speed * 10 ** (0.2 + u[0]), case.duration / 15)
            return one("amplitude", 0.1, 12, period=float(f"{period:.4g}"))
        case "load_steps":
            return one("size", 0.2, 15, rate=float(f"{(4 + 20 * u[0]) / case.duration:.4g}"))
        case "saturation":
            span, both = habit.op_hi - habit.op_lo, u[0] < 0.2
            cut = log(0.02 * span, 0.45 * span)
            lower = way < 0
            return lambda x: {
                "lo": round(habit.op_lo + cut(x), 3) if lower or both else 0.0,
                "hi": round(habit.op_hi - cut(x), 3) if not lower or both else 100.0,
            }
        case "detuning":
            angle = 2 * math.pi * u[0]
            a, b = (math.cos(angle), math.sin(angle)) if case.controller == "PI" else (way, 0.0)
            size = log(0.3, 1.6)
            return lambda x: {
                "Kc_factor": float(f"{math.exp(a * size(x)):.4g}"),
                "Ti_factor": float(f"{math.exp(b * size(x)):.4g}"),
            }
        case "error_deadband":
            return one("width", 0.5 * e, 12 * e)
        case "op_quantisation":
            return one("step", max(0.02, 0.02 * habit.op_std), 8)
        # foreign kinds
        case "positioner_cycle":
            return one("amplitude", 0.1, 8, period=float(f"{case.speed * 10 ** (-0.1 + u[0]):.4g}"))
        case "frozen_sensor":
            return one("length", 5, 120, every=round(60 + 200 * u[0], 1))
        case "bias_switching":
            return one("size", 0.5 * e, 20 * e, every=round(40 + 150 * u[0], 1))
        case "noise_bursts":
            return one("factor", 2, 40, every=round(100 + 200 * u[0], 1))
        case "missed_scans":
            return one("share", 0.05, 0.9)
        case "feedforward":
            return one("size", 0.1, 10)
        case "varying_gain":
            return one("log_range", 0.2, 1.3)
        case "valve_sleeps":
            return one("length", 4, 200, every=round(60 + 200 * u[0], 1))
        case "slew_limit":
            usual = habit.op_std / pace
            return one("slew", 2 * usual, 0.02 * usual)
        case "level_gain":
            return one("slope", way * 0.02 / case.unit, way * 0.3 / case.unit)
        case "inverse_response":
            return one("tau", 0.2 * pace, 4 * pace)
        case "derivative":
            return one("Td", 0.05 * pace, 2 * pace)
        case "sp_weight":
            return one("b", 0.9, 0.01)
    raise KeyError(name)

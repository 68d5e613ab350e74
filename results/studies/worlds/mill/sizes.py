"""How large an effect can be: for each one, a family of parameters that grows with one number,
drawn anew for each record.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from results.studies.worlds.mill import foreign_sizes
from results.studies.worlds.mill.foreign import KINDS
from results.studies.worlds.mill.loops import either, logu, signif
from results.studies.worlds.mill.scales import Family, Parameters, Scales, limits
from simbench.blind.world import WORLD_EFFECTS
from simbench.detectors.errors import ParameterError
from simbench.loop.effects import Choice


def family(effect: str, rng: np.random.Generator, s: Scales) -> Family:
    """Draw what an effect's size does not settle (direction, period, ratio of its numbers) and
    return its family.
    """
    low, high, at = _FAMILIES[effect](rng, s)
    rules = (
        WORLD_EFFECTS[effect].parameters if effect in WORLD_EFFECTS else KINDS[effect].parameters
    )
    ranges = {k: q for k, q in rules.items() if not isinstance(q, Choice)}

    def within(size: float) -> Parameters:
        values = {k: signif(v, 6) + 0.0 if k in ranges else v for k, v in at(size).items()}
        return {
            k: float(np.clip(v, ranges[k].low, ranges[k].high)) if k in ranges else v
            for k, v in values.items()
        }

    if not 0.0 < low < high:
        raise ParameterError(f"effect {effect!r} has no room in this loop")
    return Family(low, high, within)


# --- valve: S from .3 %, the least a positioner test shows, to 15 % (backlash, dead-zone: 20 %), a
# valve due for repair


def _stiction(rng, s):
    # a stem with sliding friction slips less than its band
    top = 1.0 if s.case["friction"] in ("choudhury", "he") else 0.6
    share = rng.uniform(0.1, top)
    return 0.3, 15.0, lambda x: {"S": x, "J": share * x}


def _deadband(rng, s):
    return 0.3, 20.0, lambda x: {"S": x}


def _deadzone(rng, s):
    aside = rng.uniform(-0.4, 0.4)  # the balance lies within the zone, not always at its centre
    return 0.3, 20.0, lambda x: {"D": x, "c": s.case["op0"] + aside * x}


def _valve_lag(rng, s):
    return 0.5 * s.case["Ts"], 8.0 * s.pace, lambda x: {"tau": x}


def _valve_characteristic(rng, s):
    sign = either(rng)
    return np.log(1.5), np.log(90.0), lambda x: {"R": float(np.exp(sign * x))}


# --- process: at least a quarter off, where the baseline itself may be off by a tenth


def _gain_mismatch(rng, s):
    sign = either(rng)
    return np.log(1.25), np.log(10.0), lambda x: {"factor": float(np.exp(sign * x))}


def _time_constant_mismatch(rng, s):
    if s.case["plant"]["type"] == "integrating":
        raise ParameterError("time_constant_mismatch needs a foptd plant")
    sign = either(rng)
    return np.log(1.3), np.log(12.0), lambda x: {"factor": float(np.exp(sign * x))}


def _dead_time_mismatch(rng, s):
    Td, Ts = s.case["plant"]["Td"], s.case["Ts"]
    least = max(0.6 * Ts, 0.25 * Td)
    if rng.random() < 0.3:
        return least, Td, lambda x: {"extra": -x}
    return least, 5.0 * s.pace, lambda x: {"extra": x}


def _extra_lag(rng, s):
    T = s.case["plant"].get("T", s.pace)
    return max(0.25 * T, 0.5 * s.case["Ts"]), 8.0 * s.pace, lambda x: {"tau": x}


# --- sensor


def _noise(rng, s):
    return 1.15, 100.0, lambda x: {"factor": x, "std": 0.0}


def _quantisation(rng, s):
    at = "loop" if rng.random() < 0.5 else "record"
    return 1.0 * s.noise, 12.0 * s.error, lambda x: {"step": x, "at": at}


def _sensor_lag(rng, s):
    return 0.5 * s.case["Ts"], 8.0 * s.pace, lambda x: {"tau": x}


def _compression(rng, s):
    return 0.6 * s.noise, 12.0 * s.error, lambda x: {"band": x}


def _outliers(rng, s):
    at, rate = (
        "record" if rng.random() < 0.5 else "loop",
        max(logu(rng, 0.003, 0.03), 8.0 / s.case["n"]),
    )
    return 5.0 * s.noise, 60.0 * s.error, lambda x: {"rate": rate, "size": x, "at": at}


def _ramp_and_walk(rng, s, unit: float) -> tuple[float, float, Callable[[float], Parameters]]:
    """A ramp, a walk or both, of a size x at the record's end."""
    sign, way = either(rng), rng.integers(3)
    ramp, walk = float(way != 1), float(way != 0)
    return (
        unit,
        300.0 * unit,
        lambda x: {"rate": sign * ramp * x / s.length, "walk": walk * x / np.sqrt(s.length)},
    )


def _drift(rng, s):
    return _ramp_and_walk(rng, s, 0.2 * s.error)


# --- disturbance


def _oscillation(rng, s):
    period = min(max(s.pace * logu(rng, 1.0, 15.0), 6.0 * s.case["Ts"]), s.length / 8.0)
    return 0.05, 30.0, lambda x: {"amplitude": x, "period": period}


def _load_steps(rng, s):
    rate = max(1.0 / (s.pace * logu(rng, 6.0, 50.0)), 6.0 / s.length)
    return 0.1, 30.0, lambda x: {"rate": rate, "size": x}


def _load_drift(rng, s):
    return _ramp_and_walk(rng, s, 0.2)


# --- controller


def _saturation(rng, s):
    return limits(s, int(rng.integers(3)))


def _detuning(rng, s):
    ways = [(1, 0), (-1, 0)]
    if "Ti" in s.case["controller"]:
        ways += [(0, 1), (0, -1), (1, -1), (-1, 1), (-1, -1)]
    gain, time = ways[rng.integers(len(ways))]
    return (
        np.log(1.25),
        np.log(20.0),
        lambda x: {"Kc_factor": float(np.exp(gain * x)), "Ti_factor": float(np.exp(time * x))},
    )


def _error_deadband(rng, s):
    return 0.4 * s.noise, 15.0 * s.error, lambda x: {"width": x}


def _op_quantisation(rng, s):
    return max(0.6 * s.move, 0.01), 20.0, lambda x: {"step": x}


_FAMILIES: dict[str, Callable] = {
    name: globals()["_" + name] for name in WORLD_EFFECTS
} | foreign_sizes.FAMILIES

"""How large each effect and each foreign fault is drawn: its shape at random, then one size that
the oracle searches.

A `Size` gives (1) `shape`, the random choices that stay while the size is searched, (2)
`parameters`, the numbers at one size, (3) the sizes between which a plant may lie. Sizes are
multiples of the loop's noise, error, OP or time, so that no absolute number tells the effect;
the lower ends stand clear of the nuisances in `loops` (a lattice from .4 noise std against at most
.19, an OP lattice from .25 of OP's scan-to-scan std against .1, a door that thins the record from
.3 noise std against exception reports of at most .3).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from results.studies.worlds.refinery.loops import log_uniform, pick

_Rng = np.random.Generator
GRID = np.linspace(0, 1, 201)
_Columns = dict[str, np.ndarray]


class Size(NamedTuple):
    """Shape, parameters at a size, smallest and largest size."""

    shape: Callable[[_Rng, dict, _Columns], dict]
    parameters: Callable[[float, dict, dict], dict]
    low: float
    high: float


def _none(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {}


def _sign(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def _mostly_up(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"sign": 1.0 if rng.random() < 0.75 else -1.0}


def _mix(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Ramp alone, walk alone, or both."""
    angle = pick(rng, (0.0, math.pi / 2, float(rng.uniform(0.3, 1.3))))
    return {"ramp": math.cos(angle) * float(rng.choice([-1.0, 1.0])), "walk": abs(math.sin(angle))}


def _wander(unit: float, size: float, shape: dict, case: dict) -> dict:
    """Ramp and walk that move by about size * unit over the record."""
    long = case["n"] * case["Ts"]
    walk = 0.0 if shape["walk"] < 1e-9 else shape["walk"] * size * unit / math.sqrt(long)
    return {
        "rate": 0.0 if abs(shape["ramp"]) < 1e-9 else shape["ramp"] * size * unit / long,
        "walk": walk,
    }


def _lag(size: float, shape: dict, case: dict) -> dict:
    return {"tau": max(size * case["time"], 0.15 * case["Ts"])}


def _zone(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Centre near the balance: a zone that OP never meets is no fault."""
    return {
        "c": float(np.clip(case["m0"] + rng.uniform(-0.5, 0.5) * case["scales"]["op"], 1.0, 99.0))
    }


def _dead_time(size: float, shape: dict, case: dict) -> dict:
    Td = case["plant"]["Td"]
    return {
        "extra": size * max(Td, 0.5 * case["time"]) if shape["sign"] > 0 else -min(size, 1.0) * Td
    }


def _somewhere(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Loop or record; an archive of means shows the transmitter's lattice no more, so there it is
    the archive's.
    """
    return {"at": pick(rng, ("loop", "record")) if not case["archive"]["averaging"] else "record"}


def _spikes(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"rate": log_uniform(rng, 0.002, 0.03), "at": pick(rng, ("record", "loop"), (70, 30))}


def _period(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """From far above to far below the loop's bandwidth; at least ten periods in the record."""
    time = case["time"] + case["plant"]["Td"]
    low = max(6.0 * case["Ts"], 0.8 * time)
    return {
        "period": log_uniform(
            rng, low, max(min(25.0 * time, case["n"] * case["Ts"] / 10.0), 1.5 * low)
        )
    }


def _dwell(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Levels last from 10 plant times to an eighth of the record."""
    low = 10.0 * (case["time"] + case["plant"]["Td"])
    return {"rate": 1.0 / log_uniform(rng, low, max(case["n"] * case["Ts"] / 8.0, 1.5 * low))}


def _sides(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Which limit binds, and where OP lies without it."""
    side = pick(rng, ("low", "high", "both"), (40, 40, 20))
    return {"side": side} | {name: np.quantile(seen[name], GRID) for name in ("op", "pv")}


def _limits(signal: str, lowest: float, highest: float) -> Callable[[float, dict, dict], dict]:
    """Limits that cut off the share `size` of the signal on each binding side."""

    def parameters(size: float, shape: dict, case: dict) -> dict:
        size *= 0.6 if shape["side"] == "both" else 1.0  # something must be left between the two
        lo = float(np.interp(size, GRID, shape[signal])) if shape["side"] != "high" else lowest
        hi = (
            float(np.interp(1.0 - size, GRID, shape[signal])) if shape["side"] != "low" else highest
        )
        return {"lo": lo, "hi": hi}

    return parameters


def _retuned(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Direction in (ln Kc, ln Ti): too brisk, too sluggish, or the integral alone."""
    if case["controller"]["Ti"] is None:
        return {"Kc": float(rng.choice([-1.0, 1.0])), "Ti": 0.0}
    Kc, Ti = pick(rng, ((1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (0.7, -0.7), (-0.7, 0.7)))
    return {"Kc": Kc, "Ti": Ti}


def _friction(size: float, shape: dict, case: dict) -> dict:
    return {"S": size, "J": size * case["friction"]["ratio"]}


SIZES: dict[str, Size] = {
    "stiction": Size(_none, _friction, 0.3, 15.0),
    "deadband": Size(_none, lambda s, q, c: {"S": s}, 0.3, 15.0),
    "deadzone": Size(_zone, lambda s, q, c: {"D": s, "c": q["c"]}, 0.3, 20.0),
    "valve_lag": Size(_none, _lag, 0.02, 6.0),
    "valve_characteristic": Size(
        _mostly_up, lambda s, q, c: {"R": math.exp(q["sign"] * s)}, 0.3, 3.9
    ),
    "gain_mismatch": Size(_sign, lambda s, q, c: {"factor": math.exp(q["sign"] * s)}, 0.22, 2.5),
    "time_constant_mismatch": Size(
        _sign, lambda s, q, c: {"factor": math.exp(q["sign"] * s)}, 0.22, 2.5
    ),
    "dead_time_mismatch": Size(_mostly_up, _dead_time, 0.25, 5.0),
    "extra_lag": Size(_none, _lag, 0.02, 6.0),
    "noise": Size(_none, lambda s, q, c: {"factor": 1.0 + s, "std": 0.0}, 0.1, 40.0),
    "quantisation": Size(
        _somewhere, lambda s, q, c: {"step": s * c["noise"]["std"], "at": q["at"]}, 0.4, 300.0
    ),
    "sensor_lag": Size(_none, _lag, 0.02, 6.0),
    "compression": Size(_none, lambda s, q, c: {"band": s * c["noise"]["std"]}, 0.3, 300.0),
    "outliers": Size(
        _spikes,
        lambda s, q, c: {"rate": q["rate"], "size": s * c["noise"]["std"], "at": q["at"]},
        5.0,
        1000.0,
    ),
    "drift": Size(_mix, lambda s, q, c: _wander(c["scales"]["e"], s, q, c), 0.3, 500.0),
    "oscillation": Size(
        _period,
        lambda s, q, c: {"amplitude": min(s * c["scales"]["op"], 45.0), "period": q["period"]},
        0.03,
        50.0,
    ),
    "load_steps": Size(
        _dwell,
        lambda s, q, c: {"rate": q["rate"], "size": min(s * c["scales"]["op"], 30.0)},
        0.1,
        100.0,
    ),
    "load_drift": Size(_mix, lambda s, q, c: _wander(c["scales"]["op"], s, q, c), 0.3, 200.0),
    "saturation": Size(_sides, _limits("op", 0.0, 100.0), 0.01, 0.45),
    "detuning": Size(
        _retuned,
        lambda s, q, c: {"Kc_factor": math.exp(q["Kc"] * s), "Ti_factor": math.exp(q["Ti"] * s)},
        0.15,
        3.0,
    ),
    "error_deadband": Size(_none, lambda s, q, c: {"width": s * c["scales"]["e"]}, 0.1, 40.0),
    "op_quantisation": Size(
        _none, lambda s, q, c: {"step": min(s * c["scales"]["dop"], 30.0)}, 0.25, 1000.0
    ),
}


def _episode(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Episodes of half to eight plant times, at most a fifteenth of the record."""
    time = (case["time"] + case["plant"]["Td"]) / case["Ts"]
    return {"length": min(max(log_uniform(rng, 0.5, 8.0) * time, 4.0), case["n"] / 15.0)}


def _missed(rng: _Rng, case: dict, seen: _Columns) -> dict:
    """Two to twelve scans on end, from where the controller stopped or from PV as it is."""
    return {"length": log_uniform(rng, 2.0, 12.0), "tracks": float(rng.integers(2))}


def _squared(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"full": case["scales"]["e"] * float(rng.uniform(1.5, 3.0))}


def _swell(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"tau": case["time"] * float(rng.uniform(0.12, 0.35))}


def _inverse(size: float, shape: dict, case: dict) -> dict:
    # a tank's swell must outrun its filling from the first moment: gain above 1
    return {
        "gain": size if case["plant"]["type"] == "foptd" else 1.0 + 4.0 * size,
        "tau": shape["tau"],
    }


def _recycle(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {"delay": case["plant"]["Td"] + case["time"] * float(rng.uniform(0.5, 2.5))}


def _slugs(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {**_period(rng, case, seen), "jitter": float(rng.uniform(0.2, 0.4))}


def _showers(rng: _Rng, case: dict, seen: _Columns) -> dict:
    return {
        "time": case["time"] * log_uniform(rng, 0.2, 2.0),
        "length": case["n"] * case["Ts"] * float(rng.uniform(0.03, 0.08)),
        "share": float(rng.uniform(0.15, 0.3)),
    }


FOREIGN_SIZES: dict[str, Size] = {
    "error_squared": Size(
        _squared,
        lambda s, q, c: {"share": min(s, 1.0), "error_of_full_gain": q["full"] * max(s, 1.0)},
        0.2,
        8.0,
    ),
    "hidden_derivative": Size(
        _none, lambda s, q, c: {"Td": s * (c["plant"]["Td"] + 0.3 * c["time"])}, 0.05, 4.0
    ),
    "one_way_ramp": Size(
        _none, lambda s, q, c: {"close_rate": c["scales"]["dop"] / c["Ts"] / s}, 0.3, 100.0
    ),
    "manual_episodes": Size(
        _episode, lambda s, q, c: {"length": q["length"], "share": s}, 0.03, 0.6
    ),
    "stroke_speed_limit": Size(
        _none, lambda s, q, c: {"speed": c["scales"]["dop"] / c["Ts"] / s}, 0.3, 300.0
    ),
    "jammed_travel": Size(_sides, _limits("op", 0.0, 100.0), 0.01, 0.45),
    "inverse_response": Size(_swell, _inverse, 0.3, 2.5),
    "asymmetric_response": Size(
        _sign, lambda s, q, c: {"ratio": math.exp(q["sign"] * s)}, 0.5, 3.9
    ),
    "heat_recycle": Size(_recycle, lambda s, q, c: {"share": s, "delay": q["delay"]}, 0.25, 0.9),
    "plugged_line_freeze": Size(
        _episode, lambda s, q, c: {"length": q["length"], "share": s}, 0.02, 0.6
    ),
    "sticking_float": Size(_none, lambda s, q, c: {"width": s * c["scales"]["e"]}, 0.1, 20.0),
    "range_clip": Size(_sides, _limits("pv", -1e15, 1e15), 0.01, 0.45),
    "slug_flow": Size(
        _slugs,
        lambda s, q, c: {
            "amplitude": min(s * c["scales"]["op"], 45.0),
            "period": q["period"],
            "jitter": q["jitter"],
        },
        0.05,
        50.0,
    ),
    "rain_bursts": Size(
        _showers, lambda s, q, c: {"std": min(s * c["scales"]["op"], 40.0), **q}, 0.2, 60.0
    ),
    "missed_scans": Size(_missed, lambda s, q, c: {"share": s, **q}, 0.02, 0.7),
    "zero_shift": Size(
        _dwell, lambda s, q, c: {"rate": q["rate"], "size": s * c["scales"]["e"]}, 0.1, 100.0
    ),
}

"""Draws a loop: service, plant, baseline, controller, archive, load, noise and set point, with the
reason of each range.

The classes of a loop (plant type, controller, pattern of SP, archive, sampling, length ...) come
first and from the index alone, so that they cannot tell the hidden effect; only a class that cannot
hold the effect is drawn anew.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from results.studies.worlds.refinery import archive, controller, loads, setpoint
from results.studies.worlds.refinery.baseline import fitted
from results.studies.worlds.refinery.simulation import build, run


class _Service(NamedTuple):
    """A measured variable of the refinery: its range in engineering units and customary scan
    periods (s).
    """

    name: str
    integrating: bool
    low: float
    high: float
    periods: tuple[float, ...]


# of the controller, in the baseline
_STATED, _OF_PID = ("type", "Kc", "Ti", "direction"), ("Td", "N", "b", "c", "form")
_SERVICES = (
    _Service("reflux flow, m3/h", False, 0.0, 160.0, (1.0, 2.0, 5.0)),
    _Service("stripping steam, kg/h", False, 0.0, 8000.0, (1.0, 2.0, 5.0)),
    _Service("fuel gas pressure, bar", False, 0.0, 6.0, (0.5, 1.0, 2.0)),
    _Service("column overhead pressure, kPa", False, 100.0, 450.0, (1.0, 5.0, 10.0)),
    _Service("compressor suction pressure, mbar", False, -50.0, 400.0, (0.5, 1.0, 2.0)),
    _Service("furnace outlet temperature, C", False, 250.0, 420.0, (5.0, 10.0, 20.0)),
    _Service("tray temperature, K", False, 350.0, 450.0, (5.0, 10.0, 30.0, 60.0)),
    _Service("cooler outlet temperature, F", False, 60.0, 260.0, (5.0, 10.0, 20.0)),
    _Service("overhead impurity, ppm", False, 0.0, 2500.0, (30.0, 60.0)),
    _Service("reflux drum level, %", True, 0.0, 100.0, (2.0, 5.0, 10.0)),
    _Service("column base level, mm", True, -600.0, 1400.0, (5.0, 10.0, 30.0)),
    _Service("surge tank level, m", True, 0.0, 12.0, (10.0, 30.0, 60.0)),
    _Service("gas holder pressure, mmH2O", True, 0.0, 900.0, (1.0, 2.0, 5.0)),
)


class Habits(NamedTuple):
    """How a site's ordinary loops are: shares of each class, and what the baseline leaves out."""

    loads: tuple[float, ...] = (40, 20, 8, 14, 8, 10)  # weights of `loads.LOADS`
    noises: tuple[float, ...] = (45, 25, 15, 15)  # and of `loads.NOISES`
    phi: tuple[float, float] = (0.3, 0.8)  # correlation of coloured noise from scan to scan
    higher_order: float = 0.4  # share of plants with a second lag, and half of these with a third
    lags: tuple[float, float] = (0.05, 0.15)  # these lags, of the main one
    actuator: float = 0.0  # largest lag of a sound actuator, of the main one
    filter: float = 0.0  # and of the transmitter's filter
    integrating: float = 1 / 3
    P: float = 0.15  # share of loops without integral action
    PID: float = 0.0  # and, of the others, with derivative action
    averaging: float = 0.12
    late: float = 0.3
    exceptions: float = 0.15
    known_play: float = 0.08
    knows: float = 0.09  # share by which the baseline's plant is off at most
    noise_known: float = 0.0  # and its noise
    load_told: float = 0.0  # share of the loops whose load the baseline states
    jitter: float = 0.0  # largest error of a time stamp, of a scan
    lost: float = 0.0  # share of rows that never reach the archive
    filter_stated: float = 0.0  # share of the loops with a filter whose file states it
    reset: float = 0.0  # share of the PI controllers with external reset
    bend: float = 0.0  # largest change of a plant's gain per % of travel, of the gain
    share: float = 1.0  # of the variance of coloured noise that is coloured


REFINERY = Habits()


def pick(rng: np.random.Generator, options: tuple, weights: tuple | None = None):
    """Return one of the options, with the given weights."""
    p = None if weights is None else np.array(weights) / sum(weights)
    return options[int(rng.choice(len(options), p=p))]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number between low and high, uniform in its logarithm."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def rounded(x: float, digits: int = 4) -> float:
    """Return x to that many significant digits: nobody types more into a loop file."""
    return float(f"{x:.{digits}g}")


def draw_classes(
    rng: np.random.Generator, plant: str | None = None, habits: Habits = REFINERY
) -> dict:
    """Return the classes of a loop; `plant` is a wish."""
    integrating = bool(rng.random() < habits.integrating)
    fit = [
        s
        for s in _SERVICES
        if s.integrating == (integrating if plant is None else plant == "integrating")
    ]
    service = fit[int(rng.integers(len(fit)))]
    Ts = pick(rng, service.periods)
    return {
        "service": service.name,
        "plant": "integrating" if service.integrating else "foptd",
        "Ts": Ts,
        # T, or the time in which a tank reacts: from a scan that is too slow to one of forty in T
        "time": Ts * log_uniform(rng, 3.0, 40.0),
        "Td_share": log_uniform(rng, 0.05, 1.0 if service.integrating else 1.5),
        "controller": pick(rng, ("PI", "P"), (1.0 - habits.P, habits.P)),
        "direction": pick(rng, ("reverse", "direct")),
        "sp": pick(rng, setpoint.PATTERNS, (50, 20, 12, 18)),
        "n": round(log_uniform(rng, 800, 5000)),
        "load": pick(rng, loads.LOADS, habits.loads),
        "noise": pick(rng, loads.NOISES, habits.noises),
        "averaging": bool(rng.random() < habits.averaging),
        "late": bool(rng.random() < habits.late),
        "exceptions": bool(rng.random() < habits.exceptions),
        "style": pick(rng, archive.STYLES),
        "higher_order": bool(rng.random() < habits.higher_order),
        "known_play": bool(rng.random() < habits.known_play),
    }


def _plants(
    rng: np.random.Generator,
    classes: dict,
    span: float,
    exact: frozenset,
    habits: Habits,
    small: dict,
) -> tuple[dict, dict]:
    """Return the true plant and the baseline's, in which the `small` lags of the instruments
    are.
    """
    sign = 1.0 if classes["direction"] == "reverse" else -1.0
    integrating = classes["plant"] == "integrating"
    time = classes["time"]
    # the full stroke of an ordinary valve is worth 0.4 (a tray temperature) to 2.5 spans (a flow)
    K = sign * span / 100.0 * log_uniform(rng, 0.4, 2.5)
    true = {"type": classes["plant"], "K": K / time * rng.uniform(0.2, 1.0) if integrating else K}
    true["T"] = None if integrating else time
    true["Td"] = time * classes["Td_share"]
    true["lag1"] = true["lag2"] = 0.0
    if classes["higher_order"] and "T" not in exact:
        true["lag1"] = time * rng.uniform(*habits.lags)
        true["lag2"] = time * rng.uniform(*habits.lags) if rng.random() < 0.5 else 0.0
    base = fitted(true | small)
    for name in ("K", "T", "Td"):
        if base.get(name) is None:
            continue
        if name in exact:
            # the truth takes the baseline's rounded number
            true[name] += rounded(base[name]) - base[name]
            base[name] = rounded(base[name])
        else:
            base[name] = rounded(base[name] * rng.uniform(1.0 - habits.knows, 1.0 + habits.knows))
    return true, {k: v for k, v in base.items() if v is not None}


def _tuning(
    rng: np.random.Generator, classes: dict, base: dict, time: float
) -> tuple[float, float | None]:
    """SIMC rules (Skogestad 2003) with a closed-loop time from brisk to sluggish, and an operator's
    hand on Ti.
    """
    K, Td = abs(base["K"]), base["Td"]
    if classes["plant"] == "foptd":
        wanted = max(Td * rng.uniform(0.8, 2.0), base["T"] * rng.uniform(0.25, 1.2))
        Kc, Ti = (
            base["T"] / (K * (wanted + Td)),
            min(base["T"], 4.0 * (wanted + Td)) * rng.uniform(0.8, 1.5),
        )
    else:
        wanted = Td * rng.uniform(1.0, 3.0) + time * rng.uniform(0.3, 1.5)
        Kc, Ti = 1.0 / (K * (wanted + Td)), 4.0 * (wanted + Td) * rng.uniform(0.7, 1.8)
    return rounded(Kc, 3), None if classes["controller"] == "P" else rounded(
        max(Ti, classes["Ts"]), 3
    )


def _setpoint(
    rng: np.random.Generator,
    classes: dict,
    value: float,
    span: float,
    K: float,
    Kc: float,
    time: float,
) -> dict:
    """Moves of 2 to 10 % of span, small enough that the valve can follow and the kick Kc times step
    stays below 20 %.
    """
    kind, n = classes["sp"], classes["n"]
    size = min(span * log_uniform(rng, 0.02, 0.1), 20.0 / Kc)
    if classes["plant"] == "foptd":
        size = min(size, 15.0 * abs(K))
    spec: dict = {"kind": kind, "value": value}
    if kind == "cascade":
        spec |= {
            "size": size * 0.5,
            "time": time * log_uniform(rng, 4.0, 30.0),
            "seed": int(rng.integers(2**31)),
        }
    elif kind in ("steps", "ramps"):
        count = int(rng.integers(3, 11))
        at = np.sort(rng.choice(np.arange(20, n - 20), count, replace=False))
        levels = value + size * rng.uniform(-1.0, 1.0, count)
        spec["knots"] = [[int(a), float(v)] for a, v in zip(at, levels)]
    return spec


def _archive(rng: np.random.Generator, classes: dict, case: dict, dop: float) -> dict:
    """Resolutions far below the noise: an archive that hides the noise would be an effect."""
    noise, style = case["noise"]["std"], classes["style"]
    fine = noise * log_uniform(rng, 0.002, 0.2)
    places = {
        "pv": archive.places_for(fine, case["pv0"], style),
        "sp": archive.places_for(fine, case["pv0"], style),
        "op": archive.places_for(dop * log_uniform(rng, 0.002, 0.05), case["m0"], style),
        "mv": archive.places_for(dop * log_uniform(rng, 0.002, 0.05), case["m0"], style),
    }
    return {
        "averaging": classes["averaging"],
        "late": classes["late"],
        "band": noise * float(rng.uniform(0.1, 0.3)) if classes["exceptions"] else 0.0,
        "style": style,
        "places": places,
    }


def draw_case(
    rng: np.random.Generator,
    classes: dict,
    exact: frozenset = frozenset(),
    valve_effect: bool = False,
    habits: Habits = REFINERY,
) -> dict | None:
    """Return a loop of these classes as JSON types, or None when it does not behave like a working
    loop.
    """
    service = next(s for s in _SERVICES if s.name == classes["service"])
    # transmitters are ranged to the service: a span of 40 to 100 % of the tag's customary one
    span = (service.high - service.low) * rng.uniform(0.4, 1.0)
    value = rounded(service.low + (service.high - service.low) * rng.uniform(0.35, 0.7))
    time = classes["time"]
    # a mismatch is one of numbers that the plant's own model has
    small = _instruments(rng, time, habits) if not exact else {}
    stated = habits.filter_stated > 0.0 and "filter" in small
    stated = stated and rng.random() < habits.filter_stated
    in_plant = {k: lag for k, lag in small.items() if not (stated and k == "filter")}
    true, base = _plants(rng, classes, span, exact, habits, in_plant)
    Kc, Ti = _tuning(rng, classes, base, time)
    n, Ts = classes["n"], classes["Ts"]
    tuned = {
        "type": classes["controller"], "Kc": Kc, "Ti": Ti, "direction": classes["direction"],
        "form": pick(rng, controller.FORMS) if Ti else "positional",
        "rule": pick(rng, controller.RULES, (60, 20, 20)),
        "windup": pick(rng, controller.WINDUPS),
        "op_step": 0.0,
    }  # fmt: skip
    if Ti and habits.PID and rng.random() < habits.PID:
        tuned |= _with_derivative(rng, Ti, base["Td"], Ts)
    elif Ti and habits.reset and rng.random() < habits.reset:
        tuned |= {"form": "positional", "rule": "forward", "windup": controller.RESET}
    m0 = rounded(float(rng.uniform(25.0, 75.0)), 3)
    case = {
        "service": service.name,
        "Ts": Ts,
        "n": n,
        "span": span,
        "m0": m0,
        "pv0": value,
        "time": time,
        # ten closed-loop settling times of earlier life
        "warm": int(np.clip(10 * (time + true["Td"] + (Ti or 0.0)) / Ts, 150, 1500)),
        "plant": true,
        "controller": tuned,
        "mv": False,
        "known_play": 0.0,
        "setpoint": {"kind": "constant", "value": value},
        "load": {
            "kind": classes["load"],
            "time": time * log_uniform(rng, 0.3, 10.0),
            "rate": 0.0,
            "scale": 1.0,
        },
        "noise": {"kind": classes["noise"], "std": 0.0, "phi": float(rng.uniform(*habits.phi))},
        "sensor": {"count": 0.0, "count_offset": 0.0},
        "friction": _friction(rng, Ts),
        "archive": {
            "averaging": False,
            "late": False,
            "band": 0.0,
            "style": "digits",
            "places": dict.fromkeys(("sp", "op", "pv", "mv"), 12),
        },
        "baseline": {
            "plant": base,
            "controller": {
                k: tuned[k]
                for k in (*_STATED, *(_OF_PID if tuned["type"] == "PID" else ()))
                if tuned[k] is not None
            },
            "sampling": {"Ts": Ts, "n": n},
            "noise": {"std": 0.0},
            "valve": {"model": "ideal"},
        },
        **small,
    }
    if stated:
        case["filter_stated"] = True
        case["baseline"]["effect"] = [{"name": "sensor_lag", "tau": rounded(case["filter"])}]
    if habits.bend:
        case["bend"] = float(rng.uniform(-1.0, 1.0) * habits.bend)
    if habits.share < 1.0:
        case["noise"]["share"] = habits.share
    if classes["load"] == "pink":
        case["load"]["time"] = time * log_uniform(rng, 0.1, 0.5)
    rates = {"shot": (0.2, 2.0), "telegraph": (0.04, 0.3), "steps": (0.02, 0.08)}
    if classes["load"] in rates:
        case["load"]["rate"] = log_uniform(rng, *rates[classes["load"]]) / (time + true["Td"])
    case["setpoint"] = _setpoint(rng, classes, value, span, true["K"], Kc, time)
    return _scaled(rng, classes, case, valve_effect, habits)


def _instruments(rng: np.random.Generator, time: float, habits: Habits) -> dict:
    """Return the lags (s) of a sound actuator and of the transmitter's filter, where the site has
    them: a step test shows both in the plant.
    """
    most = {"actuator": habits.actuator, "filter": habits.filter}
    return {name: time * rng.uniform(0.0, share) for name, share in most.items() if share > 0.0}


def _before_filter(case: dict) -> float:
    """Return how many times as large noise is before a transmitter's filter: what is drawn and
    stated is what is seen of it.
    """
    keep, noise = math.exp(-case["Ts"] / case["filter"]), case["noise"]
    phi, share = (noise["phi"], noise.get("share", 1.0)) if noise["kind"] == "ar1" else (0.0, 1.0)
    passes = share * (1.0 + keep * phi) / (1.0 - keep * phi) + 1.0 - share
    return math.sqrt((1.0 + keep) / (1.0 - keep) / passes)


def _with_derivative(rng: np.random.Generator, Ti: float, Td: float, Ts: float) -> dict:
    """Return what makes a PID of a PI controller: derivative of PV or of the error, or an I-PD."""
    b, c = pick(rng, ((1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (0.5, 0.0)), (45, 20, 20, 15))
    return {
        "type": "PID",
        "Td": rounded(min(0.25 * Ti, max(0.5 * Td, Ts)) * rng.uniform(0.4, 1.0), 3),
        "N": 8.0,
        "b": b,
        "c": c,
    }


def _friction(rng: np.random.Generator, Ts: float) -> dict:
    """The stem's friction law, used when friction is asked for; an actuator travels fast
    against the scan.

    LuGre slips near its break-away force only with short bristles and a Stribeck speed well above
    the bristles' and well below the slip's; else the stem creeps.
    """
    model = pick(rng, ("choudhury", "he", "karnopp", "stribeck", "lugre"))
    return {
        "model": model,
        "ratio": float(rng.uniform(0.15, 0.9)),  # J/S: Choudhury 2005 reports .1 to 1 in plant data
        "travel_time": Ts * log_uniform(rng, 0.02, 0.2),
        # Stribeck speed over the speed of the slip
        "stribeck": log_uniform(rng, 0.03, 0.12) * (0.1 if model == "lugre" else 1.0),
        "slip_end": float(rng.uniform(0.005, 0.03)),
        "bristle": log_uniform(rng, 0.001, 0.003),
    }


def _scaled(
    rng: np.random.Generator, classes: dict, case: dict, valve_effect: bool, habits: Habits
) -> dict | None:
    """Scale load and noise by what they do to PV in closed loop, then settle resolutions and
    archive.
    """
    span, wanted = case["span"], log_uniform(rng, 0.003, 0.03)
    noise, seed = log_uniform(rng, 0.03, 0.5), int(rng.integers(2**31))
    sp, case["setpoint"] = case["setpoint"], {"kind": "constant", "value": case["pv0"]}
    load_std = wanted * span
    if case["load"]["kind"] != "none":
        case["load"]["scale"] = 1e-3  # so small that no limit is met
        unit = run(build(case), case, seed)
        per_percent = float(np.std(unit["pv"])) / 1e-3
        if not np.isfinite(per_percent) or per_percent <= 0.0:
            return None
        # a load beyond 12 % of travel (std) is an upset, not an ordinary day
        case["load"]["scale"] = min(
            load_std / per_percent, 12.0, 10.0 / max(np.std(unit["op"]) / 1e-3, 1e-9)
        )
        load_std = case["load"]["scale"] * per_percent
    if load_std < 0.003 * span:
        return None
    # noise may shake the valve by 4 % at most, or somebody would have filtered it
    case["noise"]["std"] = min(noise * load_std, 4.0 / case["controller"]["Kc"])
    if case["noise"]["std"] < 0.03 * load_std:
        return None
    case["noise"]["std"] = rounded(case["noise"]["std"])
    if case.get("filter"):
        case["noise"]["gain"] = _before_filter(case)
    # a file that states the filter states the noise before it
    said = case["noise"]["std"] * (case["noise"]["gain"] if case.get("filter_stated") else 1.0)
    said = rounded(said)
    if habits.noise_known:
        said = rounded(said * rng.uniform(1.0 - habits.noise_known, 1.0 + habits.noise_known))
    case["baseline"]["noise"]["std"] = said
    if rng.random() < 0.5:
        case["sensor"]["count"] = case["noise"]["std"] * log_uniform(rng, 0.01, 0.19)
        case["sensor"]["count_offset"] = case["sensor"]["count"] * float(rng.random())
    case["setpoint"] = sp
    if classes["known_play"] and not valve_effect:
        case["known_play"] = rounded(float(rng.uniform(0.2, 1.0)), 2)
        case["baseline"]["valve"] = {"model": "deadband", "S": case["known_play"]}
    seen = run(build(case), case, seed)
    dop = float(np.std(np.diff(seen["op"])))
    case["controller"]["op_step"] = float(
        pick(rng, (0.0, 0.0, 100 / 65536, 100 / 16384, 100 / 4096, 0.1))
    )
    if case["controller"]["op_step"] > 0.1 * dop:
        case["controller"]["op_step"] = 0.0
    case["scales"] = {
        "e": float(np.std(seen["sp"] - seen["pv"])),
        "op": float(np.std(seen["op"])),
        "dop": dop,
        "load_pv": load_std,
    }
    case["archive"] = _archive(rng, classes, case, dop)
    if habits.jitter:
        case["archive"]["jitter"] = float(rng.uniform(0.0, habits.jitter))
    if habits.lost:
        case["archive"]["lost"] = float(rng.uniform(0.0, habits.lost))
    if habits.load_told and rng.random() < habits.load_told and case["load"]["kind"] == "ou":
        scale, time = (rounded(case["load"][name]) for name in ("scale", "time"))
        told = {"type": "coloured", "at": "input", "amplitude": scale, "period": time}
        case["baseline"]["disturbance"] = [told]
    return case

"""Drawing a healthy loop: plant, tuning, baseline, load, noise, set point and archive, each within
ranges met in plants.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from results.studies.worlds.mill import history
from results.studies.worlds.mill.controller import PRODUCTS, RULES
from results.studies.worlds.mill.nature import LOADS, NOISES
from results.studies.worlds.mill.plant import discretise, fitted, margins
from results.studies.worlds.mill.rig import Case, Rig
from results.studies.worlds.mill.valve import FRICTION
from simbench.detectors.errors import ParameterError

# time constant (integrating: the time the level or pressure takes to notice) in s, and Td over it;
# ranges of practice in paper mills, water works, boiler houses and compressor stations (Bialkowski
# 1993; Shinskey, Process Control Systems, 4th ed.)
_SERVICES = {
    "flow": ("foptd", (0.5, 6.0), (0.05, 0.6)),
    "steam pressure": ("foptd", (2.0, 40.0), (0.05, 0.5)),
    "consistency": ("foptd", (5.0, 40.0), (0.3, 1.5)),
    "temperature": ("foptd", (30.0, 900.0), (0.1, 1.0)),
    "pH or chlorine": ("foptd", (20.0, 300.0), (0.2, 1.5)),
    "tank level": ("integrating", (5.0, 300.0), (0.05, 0.6)),
    "drum level": ("integrating", (5.0, 60.0), (0.1, 1.0)),
    "header pressure": ("integrating", (3.0, 100.0), (0.05, 1.5)),
}
_SPANS = (
    1.0,
    1.6,
    2.5,
    4.0,
    6.0,
    10.0,
    14.0,
    25.0,
    40.0,
    60.0,
    100.0,
    150.0,
    250.0,
    400.0,
    600.0,
    1000.0,
    2500.0,
)


def logu(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw evenly in logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: np.random.Generator) -> float:
    """Draw a sign."""
    return 1.0 if rng.random() < 0.5 else -1.0


def signif(x: float, digits: int) -> float:
    """Round to so many significant digits, as an engineer writes a number down."""
    return float(f"{x:.{digits - 1}e}")


def draw_loop(rng: np.random.Generator, wish: str | None = None) -> Case:
    """Draw one healthy loop: all that `rig.Rig` needs, in JSON types."""
    for _ in range(60):
        case = _try(np.random.default_rng(rng.integers(2**63)), wish)
        if case is not None:
            return case
    raise ParameterError(f"60 drawn loops of type {wish or 'any'} have no sound margins")


def baseline(case: Case) -> dict[str, Any]:
    """Return what the plant's engineer believes: the tables of the loop file."""
    tuning = case["controller"]
    controller = {
        "type": "P" if tuning["product"] == "bias_p" else "PI",
        "Kc": tuning["Kc"],
        "direction": tuning["direction"],
    }
    if "Ti" in tuning:
        controller["Ti"] = tuning["Ti"]
    band = case["known_band"]
    return {
        "plant": dict(case["nominal"]),
        "controller": controller,
        "sampling": {"Ts": case["Ts"], "n": case["n"]},
        "noise": {"std": case["noise"]["std"]},
        "valve": {"model": "deadband", "S": band} if band > 0.0 else {"model": "ideal"},
    }


def _try(rng: np.random.Generator, wish: str | None) -> Case | None:
    kind = "integrating" if rng.random() < 1 / 3 else "foptd"
    kind = wish or kind
    services = [s for s in _SERVICES.values() if s[0] == kind]
    _, times, ratios = services[rng.integers(len(services))]
    T, span = logu(rng, *times), float(rng.choice(_SPANS))
    Ts, Td = signif(T / logu(rng, 3.2, 39.0), 2), signif(T * logu(rng, *ratios), 4)
    plant = _plant(rng, kind, T, Td, span)
    case: Case = {
        "Ts": Ts,
        "n": int(logu(rng, 800, 5000)),
        "span": span,
        "op0": round(float(rng.uniform(30, 70)), 2),
        "plant": plant,
        "nominal": _nominal(plant, rng.uniform(-0.1, 0.1, 3)),
        "known_band": round(float(rng.uniform(0.2, 1.0)), 2) if rng.random() < 0.1 else 0.0,
        "friction": str(rng.choice(list(FRICTION))),
    }
    tuning = _tuning(rng, plant, Ts, T)
    case["controller"] = tuning
    if not all(_sound(case[p], tuning, Ts) for p in ("plant", "nominal")):
        return None
    slow = T + Td + tuning.get("Ti", 0.0)
    case["warm"] = int(np.clip(8.0 * slow / Ts, 300, 4000))
    case["setpoint"] = history.draw_set_point(rng, case, T + Td)
    return case if _weather(rng, case, (T + Td) / Ts) else None


def _plant(rng: np.random.Generator, kind: str, T: float, Td: float, span: float) -> dict[str, Any]:
    """True plant; PV moves .4 to 2.5 % of span per % of travel; a third has one or two lags of 5 to
    15 % of T besides.
    """
    gain = logu(rng, 0.4, 2.5) * span / 100.0 * (-1.0 if rng.random() < 0.35 else 1.0)
    count = int(rng.integers(1, 3)) if rng.random() < 0.35 else 0
    lags = [signif(T * rng.uniform(0.05, 0.15), 4) for _ in range(count)]
    if kind == "integrating":
        return {"type": kind, "K": signif(gain / T, 4), "Td": Td, "lags": lags}
    return {"type": kind, "K": signif(gain, 4), "T": signif(T, 4), "Td": Td, "lags": lags}


def _nominal(plant: dict[str, Any], off: np.ndarray) -> dict[str, Any]:
    """First-order plant of the same step response, its numbers off by these shares."""
    T, Td = fitted(plant.get("T"), plant["Td"], plant["lags"])
    nominal = {
        "type": plant["type"],
        "K": signif(plant["K"] * (1 + off[0]), 4),
        "Td": signif(Td * (1 + off[2]), 4),
    }
    if T is not None:
        nominal["T"] = signif(T * (1 + off[1]), 4)
    return nominal


def _tuning(rng: np.random.Generator, plant: dict[str, Any], Ts: float, T: float) -> dict[str, Any]:
    """SIMC (Skogestad 2003) with a closed-loop time constant of .3 to 4 times what it recommends,
    Ti spread about it.
    """
    late = plant["Td"] + 0.5 * Ts + 0.5 * sum(plant["lags"])
    wanted = max(late, 0.25 * T) * logu(rng, 0.5, 4.0)
    proportional = rng.random() < 0.15
    if plant["type"] == "integrating":
        Kc, Ti = 1.0 / (wanted + late), 4.0 * (wanted + late) * logu(rng, 0.7, 2.5)
    elif proportional:
        Kc, Ti = logu(rng, 0.5, 5.0), 0.0
    else:
        Kc, Ti = (
            plant["T"] / (wanted + late),
            min(plant["T"], 4.0 * (wanted + late)) * logu(rng, 0.6, 2.0),
        )
    products = [p for p in PRODUCTS if p != "bias_p"]
    tuning = {
        "product": "bias_p" if proportional else str(rng.choice(products)),
        "direction": "reverse" if plant["K"] > 0 else "direct",
        "Kc": signif(Kc / abs(plant["K"]), 4),
        "tracking": round(logu(rng, 0.2, 1.0), 3),
        "resolution": 0.0,
    }
    return tuning if proportional else tuning | {"Ti": signif(Ti, 4)}


def _sound(plant: dict[str, Any], tuning: dict[str, Any], Ts: float) -> bool:
    """Largest sensitivity below 2.1, gain margin above 1.6."""
    per = Ts / tuning["Ti"] if "Ti" in tuning else 0.0
    sign = 1.0 if tuning["direction"] == "reverse" else -1.0
    peak, cross = margins(
        discretise(plant, Ts), sign * tuning["Kc"], per, *RULES[PRODUCTS[tuning["product"]].rule]
    )
    return peak < 2.1 and cross < 0.62


def _weather(rng: np.random.Generator, case: Case, pace: float) -> bool:
    """Draw load, noise and a finer archive; False where OP would swing too far."""
    target = case["span"] * logu(rng, 0.003, 0.03)
    kind = str(rng.choice(LOADS, p=[0.1, 0.3, 0.18, 0.16, 0.13, 0.13]))
    if kind == "none" and case["setpoint"]["kind"] == "constant":
        kind = "wander"  # neither load nor set point moves: a loop at rest
    slow = {
        "wander": (0.3, 5.0),
        "one_over_f": (1.0, 1.0),
        "rare_steps": (15.0, 60.0),
        "shot": (0.3, 3.0),
        "telegraph": (4.0, 30.0),
    }
    case["load"] = {
        "kind": kind,
        "std": 1.0,
        "mean": 0.0,
        "pace": pace * logu(rng, *slow.get(kind, (1.0, 1.0))),
    }
    case |= {
        "transmitter": {"count": 0.0, "count_at": 0.0},
        "noise": {"kind": "white", "shape": 0.0, "std": 0.0, "flow": 0.0},
    }
    case["archive"] = {"pv": [], "op": [], "mv": [], "sp": [], "op_late": False}
    if kind == "none":
        case["load"]["std"] = 0.0
    else:
        quiet = case | {
            "setpoint": {"value": case["setpoint"]["value"]},
            "known_band": 0.0,
            "n": 5000,
        }
        unit = [Rig.of(quiet).record(seed) for seed in (1, 2)]
        case["load"]["std"] = signif(target / float(np.mean([np.std(r["pv"]) for r in unit])), 4)
        if case["load"]["std"] * np.mean([np.std(r["op"]) for r in unit]) > 9.0:
            return False
    if case["controller"]["product"] == "bias_p":
        case["load"]["mean"] = round(float(rng.uniform(-3, 3)), 2)
    share = min(logu(rng, 0.03, 0.5), 1.5 / (case["controller"]["Kc"] * target))
    if share < 0.03:
        return False
    noise = str(rng.choice(NOISES, p=[0.5, 0.2, 0.15, 0.15]))
    shape = {"ar1": rng.uniform(0.3, 0.85), "heavy": rng.uniform(3.5, 7.0)}.get(noise, 0.0)
    flow = rng.uniform(0.5, 1.0) / case["op0"] if noise == "flow" else 0.0
    case["noise"] = {
        "kind": noise,
        "shape": float(shape),
        "std": signif(share * target, 4),
        "flow": float(flow),
    }
    history.draw_archive(rng, case)
    return True

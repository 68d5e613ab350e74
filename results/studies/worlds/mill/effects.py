"""The 22 effects of the vocabulary: each a small function that changes a rig as the contract
defines it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from results.studies.worlds.mill import valve
from results.studies.worlds.mill.archive import spikes
from results.studies.worlds.mill.foreign import KINDS
from results.studies.worlds.mill.nature import levels
from results.studies.worlds.mill.rig import Case, Rig, keep
from simbench.blind.world import WORLD_EFFECTS
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.loop.effects import Choice

Parameters = dict[str, Any]


def build(case: Case, effects: list[dict[str, Any]], nominal: bool = False) -> Rig:
    """Return the loop of a case with effects in it."""
    rig = Rig.of(case, nominal)
    seen: set[str] = set()
    for entry in effects:
        name = entry["effect"]
        if name in seen:
            raise ParameterError(f"effect {name!r} is given twice; one of each is allowed")
        seen.add(name)
        if name in KINDS:
            KINDS[name].act(rig, {**KINDS[name].identity, **entry.get("parameters", {})})
        elif name in WORLD_EFFECTS:
            ACTS[name](rig, _checked(name, entry.get("parameters", {})))
        else:
            raise UnknownName("effect", name, [*WORLD_EFFECTS, *KINDS])
    return rig


def _checked(effect: str, parameters: Parameters) -> Parameters:
    """Return all parameters of an effect of the vocabulary, those left out at identity."""
    known = WORLD_EFFECTS[effect].parameters
    full = dict(WORLD_EFFECTS[effect].identity)
    for key, value in parameters.items():
        if key not in known:
            raise UnknownName("parameter", key, known, f"effect {effect!r}")
        rule = known[key]
        if isinstance(rule, Choice):
            if value not in rule.names:
                raise ParameterError(
                    f"{effect}.{key} = {value!r}; allowed: {', '.join(rule.names)}"
                )
        elif not (math.isfinite(value) and rule.low <= value <= rule.high):
            raise ParameterError(
                f"{effect}.{key} = {value}; allowed: {rule.low:g} to {rule.high:g} {rule.unit}"
            )
        full[key] = value
    return full


# --- valve


def _friction_slot(rig: Rig, name: str) -> None:
    if rig.element["kind"] != valve.NO_FRICTION:
        raise ParameterError(
            f"effect {name!r} beside another friction or dead-zone: a valve has one"
        )


def _stiction(rig: Rig, p: Parameters) -> None:
    if p["S"] == 0.0 and p["J"] == 0.0:
        return
    if rig.case["known_band"] > 0.0:
        raise ParameterError(
            "effect 'stiction' beside the known dead-band of this valve: the contract refuses it"
        )
    _friction_slot(rig, "stiction")
    # a stem of mass and spring cannot jump further than its band; only the data-driven map can
    model = rig.case["friction"] if p["J"] <= p["S"] else "choudhury"
    first, second = valve.friction_numbers(p["S"], p["J"])
    rig.element |= {"kind": valve.FRICTION[model][0], "first": first, "second": second}


def _deadband(rig: Rig, p: Parameters) -> None:
    rig.element["band"] += p["S"]  # two plays in series are one, as wide as both


def _deadzone(rig: Rig, p: Parameters) -> None:
    if p["D"] > 0.0:
        _friction_slot(rig, "deadzone")
        rig.element |= {"kind": valve.DEADZONE, "first": p["D"], "second": p["c"]}


def _valve_lag(rig: Rig, p: Parameters) -> None:
    rig.element["keep"] = keep(p["tau"], rig.case["Ts"])


def _valve_characteristic(rig: Rig, p: Parameters) -> None:
    rig.element["R"] = p["R"]
    rig.place["op0"] = valve.opening(rig.place["mv0"], p["R"])


# --- process


def _gain_mismatch(rig: Rig, p: Parameters) -> None:
    rig.plant["K"] *= p["factor"]


def _time_constant_mismatch(rig: Rig, p: Parameters) -> None:
    if rig.plant["type"] == "integrating":
        raise ParameterError(
            "effect 'time_constant_mismatch' in an integrating loop; it needs a foptd plant"
        )
    rig.plant["T"] *= p["factor"]


def _dead_time_mismatch(rig: Rig, p: Parameters) -> None:
    rig.plant["Td"] = max(0.0, rig.plant["Td"] + p["extra"])


def _extra_lag(rig: Rig, p: Parameters) -> None:
    if p["tau"] > 0.0:
        rig.plant["lags"] = [*rig.plant.get("lags", ()), p["tau"]]


# --- sensor


def _noise(rig: Rig, p: Parameters) -> None:
    std0, factor = rig.case["noise"]["std"], p["factor"]
    added = math.sqrt(max(factor**2 - 1.0, 0.0) * std0**2 + p["std"] ** 2)

    def change(rng, t, rows):
        rows["noise"] *= min(factor, 1.0)
        rows["noise"] += added * rng.standard_normal(len(t))

    rig.changes.append(("noise effect", change))


def _quantisation(rig: Rig, p: Parameters) -> None:
    if p["at"] == "loop":
        rig.sensor["step"] = p["step"]
    elif p["step"] > 0.0:
        rig.stages.append({"stage": "lattice", "step": p["step"]})


def _sensor_lag(rig: Rig, p: Parameters) -> None:
    rig.sensor["keep"] = keep(p["tau"], rig.case["Ts"])


def _compression(rig: Rig, p: Parameters) -> None:
    if p["band"] > 0.0:
        rig.stages.append({"stage": "door", "band": p["band"]})


def _outliers(rig: Rig, p: Parameters) -> None:
    if p["rate"] == 0.0 or p["size"] == 0.0:
        return
    if p["at"] == "record":
        rig.stages.append({"stage": "spikes", "rate": p["rate"], "size": p["size"]})
        return

    def change(rng, t, rows):
        rows["spikes"] += spikes(len(t), p["rate"], p["size"], rng)

    rig.changes.append(("outliers", change))


def _drift(rig: Rig, p: Parameters) -> None:
    rig.changes.append(("drift", _moving("wander", p)))


# --- disturbance


def _oscillation(rig: Rig, p: Parameters) -> None:
    if p["amplitude"] == 0.0 or p["period"] == 0.0:
        return

    def change(rng, t, rows):
        rows["load"] += p["amplitude"] * np.sin(2.0 * math.pi * (t / p["period"] + rng.random()))

    rig.changes.append(("oscillation", change))


def _load_steps(rig: Rig, p: Parameters) -> None:
    Ts = rig.case["Ts"]

    def change(rng, t, rows):
        rows["load"] += p["size"] * levels(min(p["rate"] * Ts, 1.0), len(t), rng)

    rig.changes.append(("load steps", change))


def _load_drift(rig: Rig, p: Parameters) -> None:
    rig.changes.append(("load drift", _moving("load", p)))


def _moving(row: str, p: Parameters) -> Callable:
    """A ramp plus a random walk, both 0 at the record's first sample."""

    def change(rng, t, rows):
        walk = np.cumsum(rng.standard_normal(len(t))) * math.sqrt(t[1] - t[0])
        rows[row] += p["rate"] * t + p["walk"] * (walk - walk[np.searchsorted(t, 0.0)])

    return change


# --- controller


def _saturation(rig: Rig, p: Parameters) -> None:
    if p["lo"] >= p["hi"]:
        raise ParameterError(f"saturation.lo = {p['lo']} is not below saturation.hi = {p['hi']}")
    rig.law |= {"lo": p["lo"], "hi": p["hi"]}


def _detuning(rig: Rig, p: Parameters) -> None:
    if rig.Ti is None and p["Ti_factor"] != 1.0:
        raise ParameterError(
            f"detuning.Ti_factor = {p['Ti_factor']} on a P controller; it has no Ti"
        )
    rig.Kc *= p["Kc_factor"]
    rig.Ti = None if rig.Ti is None else rig.Ti * p["Ti_factor"]


def _error_deadband(rig: Rig, p: Parameters) -> None:
    rig.law["deadband"] = p["width"]


def _op_quantisation(rig: Rig, p: Parameters) -> None:
    rig.law["step"] = p["step"]


ACTS: dict[str, Callable[[Rig, Parameters], None]] = {
    name: globals()["_" + name] for name in WORLD_EFFECTS
}

"""Fifteen faults of mills, water works, boilers and compressor stations that the vocabulary has no
word for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

from results.studies.worlds.mill.nature import spells
from results.studies.worlds.mill.rig import Rig
from simbench.detectors.errors import ParameterError

Parameters = dict[str, Any]
_BIG = 1e9


class _Quantity(NamedTuple):
    """One number of a fault: unit, bounds, the value at which it does nothing, its meaning."""

    unit: str
    low: float
    high: float
    identity: float
    says: str


class _Kind(NamedTuple):
    """A foreign fault: its block, its meaning, its numbers, what it does to a rig."""

    block: str
    says: str
    parameters: dict[str, _Quantity]
    act: Callable[[Rig, Parameters], None]

    @property
    def identity(self) -> Parameters:
        """Numbers under which the fault changes nothing."""
        return {k: q.identity for k, q in self.parameters.items()}


def _scan_overrun(rig: Rig, p: Parameters) -> None:
    Ts, every = rig.case["Ts"], round(p["scans"])

    def change(rng, t, rows):
        busy = spells(rng, len(t), p["share"], max(2.0, p["length"] / Ts))
        rows["mode"][busy & (np.arange(len(t)) % every != 0)] = 3

    if p["share"] > 0.0 and every > 1:
        rig.changes.append(("overrun", change))


def _steam_feedforward(rig: Rig, p: Parameters) -> None:
    if p["gain"] == 0.0:
        return
    if rig.case["load"]["std"] == 0.0:
        raise ParameterError(
            "foreign kind 'steam_feedforward' in a loop without load; there is nothing to feed"
            " forward"
        )
    error = 0.01 * rig.case["load"]["std"]

    def change(rng, t, rows):
        rows["forward"] -= p["gain"] * (rows["load"] + error * rng.standard_normal(len(t)))

    rig.changes.append(("feedforward", change))


def _manual_spells(rig: Rig, p: Parameters) -> None:
    Ts = rig.case["Ts"]
    rig.law["hand"] = rig.Kc * 0.7

    def change(rng, t, rows):
        spell = max(2.0, p["length"] / Ts)
        manual = spells(rng, len(t), p["share"], spell)
        corrects = rng.random(len(t)) < 4.0 / spell
        rows["mode"][manual] = 1
        rows["mode"][manual & corrects] = 2

    if p["share"] > 0.0:
        rig.changes.append(("manual", change))


def _stroke_speed(rig: Rig, p: Parameters) -> None:
    rig.element["rate"] = p["rate"] * rig.case["Ts"]


def _travel_stop(rig: Rig, p: Parameters) -> None:
    rig.element |= {"stop_lo": p["lo"], "stop_hi": p["hi"]}


def _positioner_ringing(rig: Rig, p: Parameters) -> None:
    if p["period"] <= 0.0:
        return
    w = 2.0 * math.pi / p["period"]
    big = np.zeros((3, 3))
    big[:2] = [[0.0, 1.0, 0.0], [-w * w, -2.0 * p["damping"] * w, w * w]]
    rig.element["ring"] = np.ascontiguousarray(expm(big * rig.case["Ts"])[:2])


def _shrink_swell(rig: Rig, p: Parameters) -> None:
    if p["lead"] > 0.0:
        rig.plant["sections"] = [*rig.plant.get("sections", ()), ["swell", p["lead"]]]


def _header_resonance(rig: Rig, p: Parameters) -> None:
    if p["period"] > 0.0:
        rig.plant["sections"] = [
            *rig.plant.get("sections", ()),
            ["resonance", p["period"], p["damping"]],
        ]


def _titration(rig: Rig, p: Parameters) -> None:
    rig.sensor |= {"width": p["width"], "shape": p["shape"]}


def _white_water(rig: Rig, p: Parameters) -> None:
    rig.place |= {
        "share": p["share"],
        "back": max(1, round(p["delay"] / rig.case["Ts"])) if p["share"] > 0.0 else 0,
    }


def _frozen_spells(rig: Rig, p: Parameters) -> None:
    Ts = rig.case["Ts"]

    def change(rng, t, rows):
        rows["held"][spells(rng, len(t), p["share"], max(2.0, p["length"] / Ts))] = 1

    if p["share"] > 0.0:
        rig.changes.append(("frozen", change))


def _scanner_hold(rig: Rig, p: Parameters) -> None:
    cycle = max(1, round(p["cycle"] / rig.case["Ts"]))

    def change(rng, t, rows):
        rows["held"][(np.arange(len(t)) + rng.integers(cycle)) % cycle < p["held"] * cycle] = 1

    if cycle > 1 and p["held"] > 0.0:
        rig.changes.append(("scanner", change))


def _entrained_air(rig: Rig, p: Parameters) -> None:
    Ts = rig.case["Ts"]

    def change(rng, t, rows):
        dips = (rng.random(len(t)) < p["rate"] * Ts) * p["depth"] * (0.5 + rng.random(len(t)))
        rows["wander"] -= lfilter([1.0], [1.0, -math.exp(-Ts / p["length"])], dips)

    if p["depth"] > 0.0 and p["rate"] > 0.0:
        rig.changes.append(("air", change))


def _backwash(rig: Rig, p: Parameters) -> None:
    def change(rng, t, rows):
        rows["load"] -= p["height"] * (((t / p["period"]) + rng.random()) % 1.0 < p["duty"])

    if p["height"] > 0.0:
        rig.changes.append(("backwash", change))


def _surge_bursts(rig: Rig, p: Parameters) -> None:
    Ts = rig.case["Ts"]

    def change(rng, t, rows):
        half = 0.5 * p["cycles"] * p["period"]
        s = np.arange(-half, half, Ts)
        burst = np.exp(-0.5 * (3.0 * s / half) ** 2) * np.sin(2.0 * math.pi * s / p["period"])
        starts = (rng.random(len(t)) < p["rate"] * Ts) * (0.6 + 0.8 * rng.random(len(t)))
        rows["upset"] += p["amplitude"] * np.convolve(starts, burst)[: len(t)]

    if p["amplitude"] > 0.0:
        rig.changes.append(("surge", change))


KINDS: dict[str, _Kind] = {
    "scan_overrun": _Kind(
        "controller",
        "spells in which an overloaded processor runs the controller at every m-th scan only and"
        " holds OP between",
        {
            "share": _Quantity("-", 0.0, 0.95, 0.0, "share of the time"),
            "length": _Quantity("s", 0.0, _BIG, 100.0, "mean length of a spell"),
            "scans": _Quantity(
                "samples", 1.0, 100.0, 1.0, "m; the integral does not know of the scans missed"
            ),
        },
        _scan_overrun,
    ),
    "steam_feedforward": _Kind(
        "controller",
        "a feedforward from the measured load that the baseline does not know (three-element drum"
        " level)",
        {"gain": _Quantity("-", 0.0, 3.0, 0.0, "1 would cancel the load; measured with 1 % error")},
        _steam_feedforward,
    ),
    "manual_spells": _Kind(
        "controller",
        "spells in manual: OP stands, an operator corrects it now and then, the return is bumpless",
        {
            "share": _Quantity("-", 0.0, 0.9, 0.0, "share of the time in manual"),
            "length": _Quantity("s", 0.0, _BIG, 100.0, "mean length of a spell"),
        },
        _manual_spells,
    ),
    "stroke_speed": _Kind(
        "valve",
        "the stem travels at a limited speed (starved air supply, electric actuator, large damper)",
        {"rate": _Quantity("%/s", 0.0, _BIG, _BIG, "fastest travel")},
        _stroke_speed,
    ),
    "travel_stop": _Kind(
        "valve",
        "a mechanical stop or debris keeps the stem from part of its travel while OP goes on",
        {
            "lo": _Quantity("%", 0.0, 100.0, 0.0, "lower stop"),
            "hi": _Quantity("%", 0.0, 100.0, 100.0, "upper stop"),
        },
        _travel_stop,
    ),
    "positioner_ringing": _Kind(
        "valve",
        "a pneumatic actuator whose positioner is tuned too hot: the stem rings after every move",
        {
            "period": _Quantity("s", 0.0, _BIG, 0.0, "natural period; 0 = a stiff positioner"),
            "damping": _Quantity("-", 0.02, 1.0, 0.2, "damping ratio"),
        },
        _positioner_ringing,
    ),
    "shrink_swell": _Kind(
        "process",
        "inverse response (1 - a s)/(1 + .3 a s): drum level after feedwater, bark boiler after"
        " fuel",
        {"lead": _Quantity("s", 0.0, _BIG, 0.0, "a")},
        _shrink_swell,
    ),
    "header_resonance": _Kind(
        "process",
        "a lightly damped mode in series (steam or gas header, suction drum, long water main)",
        {
            "period": _Quantity("s", 0.0, _BIG, 0.0, "natural period; 0 = none"),
            "damping": _Quantity("-", 0.02, 1.0, 0.2, "damping ratio"),
        },
        _header_resonance,
    ),
    "titration": _Kind(
        "process",
        "PV bends away from the set point like a titration curve, slope 1 at the set point",
        {
            "width": _Quantity(
                "PV units", 0.0, _BIG, 0.0, "deviation at which it bends; 0 = straight"
            ),
            "shape": _Quantity(
                "-",
                -1.0,
                1.0,
                1.0,
                "+1 flattens (asinh: neutral point), -1 steepens (sinh: buffered)",
            ),
        },
        _titration,
    ),
    "white_water_recycle": _Kind(
        "process",
        "a share of the flow comes back to the inlet after a long delay (white water, recycled"
        " condensate)",
        {
            "share": _Quantity("-", 0.0, 0.95, 0.0, "of the flow"),
            "delay": _Quantity("s", 0.0, _BIG, 0.0, "round trip"),
        },
        _white_water,
    ),
    "frozen_spells": _Kind(
        "sensor",
        "PV repeats its last value for spells (plugged impulse line, lost link)",
        {
            "share": _Quantity("-", 0.0, 0.9, 0.0, "share of the time"),
            "length": _Quantity("s", 0.0, _BIG, 100.0, "mean length of a spell"),
        },
        _frozen_spells,
    ),
    "scanner_hold": _Kind(
        "sensor",
        "PV is held for part of every cycle (traversing scanner off the sheet, analyser while it"
        " purges)",
        {
            "cycle": _Quantity("s", 0.0, _BIG, 100.0, "cycle time"),
            "held": _Quantity("-", 0.0, 0.98, 0.0, "share of the cycle"),
        },
        _scanner_hold,
    ),
    "entrained_air": _Kind(
        "sensor",
        "PV dips at random times and recovers over several samples (air in a flow tube, bubbles at"
        " a probe)",
        {
            "rate": _Quantity("1/s", 0.0, _BIG, 0.0, "dips per second"),
            "depth": _Quantity("PV units", 0.0, _BIG, 0.0, "mean depth"),
            "length": _Quantity("s", 0.0, _BIG, 10.0, "time constant of the recovery"),
        },
        _entrained_air,
    ),
    "backwash_pulses": _Kind(
        "disturbance",
        "a rectangular load pulse at regular intervals (filter backwash, batch digester blow)",
        {
            "height": _Quantity("%", 0.0, 100.0, 0.0, "of the pulse, at the plant's input"),
            "period": _Quantity("s", 0.0, _BIG, 1000.0, "between pulses"),
            "duty": _Quantity("-", 0.0, 1.0, 0.1, "share of the period"),
        },
        _backwash,
    ),
    "surge_bursts": _Kind(
        "disturbance",
        "bursts of a few cycles that strike PV itself at random times (incipient compressor surge)",
        {
            "amplitude": _Quantity("PV units", 0.0, _BIG, 0.0, "largest swing of a mean burst"),
            "period": _Quantity("s", 0.0, _BIG, 10.0, "of its cycles"),
            "cycles": _Quantity("-", 1.0, 50.0, 6.0, "length of a burst"),
            "rate": _Quantity("1/s", 0.0, _BIG, 0.0, "bursts per second"),
        },
        _surge_bursts,
    ),
}

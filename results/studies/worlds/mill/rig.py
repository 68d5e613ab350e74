"""A loop made ready to run: the parts of one case, which effects change, and the record that comes
out of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from results.studies.worlds.mill import nature, valve
from results.studies.worlds.mill.archive import Stage, archived, ordered
from results.studies.worlds.mill.controller import PRODUCTS, PROPORTIONAL, RULES
from results.studies.worlds.mill.loop import Element, Law, Place, Sensor, Signals, run
from results.studies.worlds.mill.plant import discretise
from simbench.blind.menu import TestPlan, operated

Case = dict[str, Any]
_Rows = dict[str, np.ndarray]
# changes the rows of signals in place, given a random stream and the times
_Change = Callable[[np.random.Generator, np.ndarray, _Rows], None]


@dataclass
class Rig:
    """The parts of a loop, open to change until it runs; `case` itself is never changed."""

    case: Case
    plant: dict[str, Any]
    Kc: float
    Ti: float | None
    law: dict[str, float] = field(default_factory=dict)
    element: dict[str, Any] = field(default_factory=dict)
    sensor: dict[str, float] = field(default_factory=dict)
    place: dict[str, float] = field(default_factory=dict)
    stages: list[Stage] = field(default_factory=list)
    changes: list[tuple[str, _Change]] = field(default_factory=list)

    @classmethod
    def of(cls, case: Case, nominal: bool = False) -> Rig:
        """Return the loop of a case without any effect; `nominal` = on the baseline's plant."""
        tuning = case["controller"]
        now, before = RULES[PRODUCTS[tuning["product"]].rule]
        return cls(
            case,
            dict(case["nominal"] if nominal else case["plant"]),
            tuning["Kc"],
            tuning.get("Ti"),
            law={
                "now": now,
                "before": before,
                "lo": 0.0,
                "hi": 100.0,
                "deadband": 0.0,
                "step": 0.0,
                "hand": 0.0,
            },
            element={
                "band": case["known_band"],
                "kind": valve.NO_FRICTION,
                "first": 0.0,
                "second": 0.0,
                "R": 1.0,
                "keep": 0.0,
                "rate": math.inf,
                "stop_lo": 0.0,
                "stop_hi": 100.0,
                "ring": np.zeros((2, 3)),
            },
            sensor={
                "keep": 0.0,
                "step": 0.0,
                "width": 0.0,
                "shape": 1.0,
                **case["transmitter"],
                "flow": case["noise"]["flow"],
            },
            place={
                "pv0": case["setpoint"]["value"],
                "mv0": case["op0"],
                "op0": case["op0"],
                "share": 0.0,
                "back": 0,
            },
            stages=list(case["archive"]["pv"]),
        )

    def record(self, seed: int, plan: TestPlan | None = None) -> dict[str, np.ndarray]:
        """Run under a seed and return the record's columns t, sp, op, pv, mv (all of them), each
        (n,); or those of a test.
        """
        case, warm = self.case, self.case["warm"]
        rows, _ = self.rows(seed)
        if plan is not None:
            rows["sp"][:] = case["setpoint"]["value"]
            rows["sp"][warm:] += plan.sp
            rows["hand"][warm:] = plan.op
            # between its scans the controller rests, however fast the log
            between = (np.arange(rows["sp"].size) - warm) % plan.faster != 0
            rows["mode"] = np.where(between, 3, rows["mode"]).astype(np.int8)
        plant = discretise(self.plant, case["Ts"])
        out = run(
            plant, self._law(), self._element(), self._sensor(), Signals(**rows), self._place()
        )
        # a late logger writes what stood in the output register before this scan, the valve's
        # answer with it
        raw = plan is not None and plan.raw
        late = 1 if case["archive"]["op_late"] and not raw else 0
        first = {"sp": warm, "pv": warm, "op": warm - late, "mv": warm - late}
        out["sp"] = rows["sp"]
        columns = {"t": np.round(np.arange(case["n"]) * case["Ts"], 9)}
        for name in ("sp", "op", "pv", "mv"):
            stages = ordered(self.stages) if name == "pv" else case["archive"][name]
            columns[name] = archived(
                out[name][first[name] :][: case["n"]], [] if raw else stages, seed
            )
        return columns if plan is None else operated(columns, out["true"][warm:], plan, seed)

    def rows(self, seed: int) -> tuple[_Rows, np.ndarray]:
        """Return the signals from outside for this seed, one row a sample, and their times (s)."""
        case = self.case
        N, load, noise = case["warm"] + case["n"], case["load"], case["noise"]
        t = (np.arange(N) - case["warm"]) * case["Ts"]
        rows: _Rows = {k: np.zeros(N) for k in ("wander", "upset", "spikes", "forward")}
        rows |= {
            "mode": np.zeros(N, np.int8),
            "held": np.zeros(N, np.int8),
            "hand": np.full(N, np.nan),
        }
        rows["sp"] = nature.set_point(case["setpoint"], t)
        rows["load"] = load["mean"] + load["std"] * nature.load(
            load["kind"], load["pace"], N, nature.stream(seed, "load")
        )
        rows["noise"] = noise["std"] * nature.noise(
            noise["kind"], noise["shape"], N, nature.stream(seed, "noise")
        )
        for name, change in self.changes:
            change(nature.stream(seed, name), t, rows)
        return rows, t

    def _law(self) -> Law:
        tuning, p = self.case["controller"], self.law
        product = PRODUCTS[tuning["product"]].law
        Ts = self.case["Ts"]
        per_scan = 0.0 if product == PROPORTIONAL or self.Ti is None else Ts / self.Ti
        back = 0.0 if self.Ti is None else min(1.0, Ts / (tuning["tracking"] * self.Ti))
        sign = 1.0 if tuning["direction"] == "reverse" else -1.0
        return Law(
            product,
            sign,
            self.Kc,
            self.Kc * per_scan,
            p["now"],
            p["before"],
            back,
            float(p["lo"]),
            float(p["hi"]),
            float(p["deadband"]),
            float(p["step"]),
            float(tuning["resolution"]),
            float(p["hand"]),
        )

    def _element(self) -> Element:
        e = self.element
        numbers = [
            float(e[k]) for k in ("first", "second", "R", "keep", "rate", "stop_lo", "stop_hi")
        ]
        return Element(float(e["band"]), int(e["kind"]), *numbers, e["ring"])

    def _sensor(self) -> Sensor:
        return Sensor(
            *(
                float(self.sensor[k])
                for k in ("keep", "step", "count", "count_at", "flow", "width", "shape")
            )
        )

    def _place(self) -> Place:
        p = self.place
        return Place(
            float(p["pv0"]), float(p["mv0"]), float(p["op0"]), float(p["share"]), int(p["back"])
        )


def keep(tau: float, Ts: float) -> float:
    """Return exp(-Ts/tau), what a first-order lag keeps of its state over one sample; 0 for tau =
    0.
    """
    return math.exp(-Ts / tau) if tau > 0.0 else 0.0

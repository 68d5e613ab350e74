"""The tests that can be requested for a loop of the blind test, sized from its baseline and record
alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

MENU = ("mv", "sp_steps", "kc_half", "bump", "stairs", "still", "raw", "fast", "lab")
_LEAD = 120  # samples in automatic before a test in manual
_MOST = 1500  # samples
_FASTER = 4
_SAMPLES_OF_LAB = 40
_LAB_STD = 0.5  # of the stated noise


@dataclass(frozen=True, eq=False)
class TestPlan:
    """One test on a loop."""

    id: str
    n: int  # samples, at the period of the log
    sp: np.ndarray  # (n,) deviation of SP (PV units) from where it is
    op: np.ndarray  # (n,) deviation of OP (%) from where the operator takes over; NaN in automatic
    Kc_ratio: float = 1.0  # factor on the controller's gain
    faster: int = 1  # samples of the log in one of the controller
    raw: bool = False  # whether no archive lies between
    mv: bool = False  # whether the stem position is logged
    lab: np.ndarray | None = (
        # samples at which the true process value is taken, and the std of its error (PV units)
        None
    )
    lab_std: float = 0.0

    @property
    def manual(self) -> np.ndarray:
        """Where OP is the operator's."""
        return np.isfinite(self.op)

    def settings(self, Ts: float) -> dict[str, dict[str, Any]]:
        """Return the tables that are declared with the record; `Ts` of the controller (s)."""
        test: dict[str, Any] = {"id": self.id}
        if self.manual.any():
            moves = self.op[self.manual]
            edges = np.flatnonzero(np.diff(moves)) + 1
            test |= {"sp_in_man": "holds", "levels": [float(x) for x in moves[np.append(0, edges)]]}
        if self.raw:
            test["archive"] = "raw"
        if self.lab is not None:
            test["lab_std"] = self.lab_std
        out = {"test": test}
        if self.Kc_ratio != 1.0:
            out["controller"] = {"Kc_ratio": self.Kc_ratio}
        if self.faster != 1:
            out["sampling"] = {"Ts": Ts / self.faster}
        return out


def plan(id_: str, columns: Mapping[str, np.ndarray], baseline: Mapping[str, Any]) -> TestPlan:
    """Return a test of the menu for a loop."""
    plant, control, Ts = (
        baseline["plant"],
        baseline["controller"],
        float(baseline["sampling"]["Ts"]),
    )
    integrating = plant["type"] == "integrating"
    gain, Td = abs(float(plant["K"])), float(plant["Td"]) / Ts
    pace = Td + (
        1.0 / (gain * float(control["Kc"]) * Ts) if integrating else float(plant["T"]) / Ts
    )
    op = np.asarray(columns["op"])
    room = 0.5 * min(float(op[:_LEAD].mean()), 100.0 - float(op[:_LEAD].mean()))
    d = float(np.clip(2.0 * op.std(), 1.0, max(min(10.0, room), 1.0)))
    size = d * gain * (Ts * pace if integrating else 1.0)
    hold = (
        int(np.clip(12.0 * pace, 20, _MOST // 5))
        if id_ == "sp_steps"
        else int(np.clip(6.0 * pace, 15, _MOST // 8))
    )
    levels: list[float] = []
    if id_ in ("sp_steps", "bump"):
        levels = [0.0, 1.0, -1.0, 0.0] if id_ == "bump" else [1.0, -1.0, 0.0, -1.0, 1.0]
        if integrating and id_ == "bump":
            hold, levels = max(int(pace), 5), [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0]
    elif id_ == "stairs":
        levels = [0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25, 0.0, -0.25, -0.5, -0.25, 0.0]
        if integrating:
            hold, levels = (
                max(int(pace), 5),
                [x * s for x in (0.25, 0.5, 0.75, 1.0) for s in (1.0, 0.0, -1.0, 0.0)],
            )
    elif id_ == "still":
        levels, hold = [0.0], int(np.clip(20.0 * pace, 200, _MOST))
    moves = np.repeat(levels, hold)
    n = _LEAD + moves.size if levels else min(op.size, _MOST)
    sp, hand = np.zeros(n), np.full(n, np.nan)
    if id_ == "sp_steps":
        sp[_LEAD:] = size * moves
    elif levels:
        hand[_LEAD:] = d * moves
    if id_ == "fast":
        n = min(_FASTER * op.size, 2 * _MOST) // _FASTER * _FASTER
        return TestPlan(id_, n, np.zeros(n), np.full(n, np.nan), faster=_FASTER)
    lab = np.linspace(5, n - 5, _SAMPLES_OF_LAB).astype(int) if id_ == "lab" else None
    noise = float(baseline.get("noise", {}).get("std", 0.0))
    return TestPlan(
        id_,
        n,
        sp,
        hand,
        Kc_ratio=0.5 if id_ == "kc_half" else 1.0,
        raw=id_ == "raw",
        mv=id_ == "mv",
        lab=lab,
        lab_std=_LAB_STD * noise if id_ == "lab" else 0.0,
    )


def operated(
    columns: dict[str, np.ndarray], true: np.ndarray, test: TestPlan, seed: int
) -> dict[str, np.ndarray]:
    """Return the columns of a test with its mode (1 in manual) and its lab samples of the true PV
    (NaN between).
    """
    if test.manual.any():
        columns["mode"] = test.manual.astype(float)
    if test.lab is not None:
        columns["lab"] = np.full(test.n, np.nan)
        error = test.lab_std * np.random.default_rng([seed, 77]).standard_normal(test.lab.size)
        columns["lab"][test.lab] = true[test.lab] + error
    return columns


def csv_of(columns: Mapping[str, np.ndarray]) -> str:
    """Return a record as the text of its CSV: the mode in words, no number where no sample was
    taken.
    """
    rows = zip(*([_cell(name, x) for x in c.tolist()] for name, c in columns.items()), strict=True)
    return "\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n"


def _cell(name: str, x: float) -> str:
    if name == "mode":
        return "MAN" if x else "AUTO"
    return f"{x:.8g}" if np.isfinite(x) else ""


def settings_toml(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a test's settings as TOML."""
    # of plain words, numbers and lists of numbers JSON is TOML
    rows = [
        [f"[{name}]", *(f"{k} = {json.dumps(v)}" for k, v in table.items())]
        for name, table in settings.items()
    ]
    return "\n".join("\n".join(part) + "\n" for part in rows)

"""The interface of an independent plant simulator: it draws records with hidden effects, and can
simulate their loops again and run tests on them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from simbench.loop.effects import EFFECTS, Vocabulary

# in this order since the first set was sealed: a seed means the same records for ever, whatever
# effects are added or installed
PLANNED = (
    "stiction",
    "deadband",
    "deadzone",
    "valve_lag",
    "valve_characteristic",
    "gain_mismatch",
    "time_constant_mismatch",
    "dead_time_mismatch",
    "extra_lag",
    "noise",
    "quantisation",
    "sensor_lag",
    "compression",
    "outliers",
    "drift",
    "oscillation",
    "load_steps",
    "load_drift",
    "saturation",
    "detuning",
    "error_deadband",
    "op_quantisation",
)
WORLD_EFFECTS = Vocabulary(PLANNED)
# foreign kinds of a world that the library knows, each by the library's name
KNOWN_AS = {
    "derivative": "derivative_action",
    "hidden_derivative": "derivative_action",
    "missed_scans": "missed_executions",
    "plugged_line_freeze": "frozen_sensor",
    "stroke_speed_limit": "slew_limit",
}


def right_names(answer: Mapping[str, Any]) -> set[str]:
    """Return the effects of which each is a right answer: one or two; of a foreign one `unknown`,
    or its name alone where the library knows it after all.
    """
    foreign = KNOWN_AS.get(answer.get("foreign"), answer.get("foreign"))
    if foreign in EFFECTS:
        return {foreign}
    return {name for name in (answer["effect"], answer.get("effect2")) if name}


class Item(NamedTuple):
    """One record (columns t, sp, op, pv and mv where recorded), the baseline handed out with it,
    and the truth.

    Parameters
    ----------
    columns : dict of str to ndarray, shape (n,)
        Signals by name: t (s), sp and pv (PV units), op (%), mv (%) where it is recorded.
    baseline : dict
        Loop file, as a nested table, that is handed out with the record.
    answer : dict
        The truth, and all that `simulate` and `test` need to run the loop again.
    """

    columns: dict[str, np.ndarray]
    baseline: dict[str, Any]
    answer: dict[str, Any]


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

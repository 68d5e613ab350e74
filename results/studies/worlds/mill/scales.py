"""What sizes are measured by: the scales of a healthy loop, and parameters as a function of one
size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from results.studies.worlds.mill.rig import Case
from results.studies.worlds.mill.statistics import Record

Parameters = dict[str, Any]


class Family(NamedTuple):
    """Parameters as a function of a size between two bounds: the least that is no nuisance, the
    most that is believable.
    """

    low: float
    high: float
    at: Callable[[float], Parameters]


@dataclass(frozen=True)
class Scales:
    """What the healthy loop looks like: the measures by which effects are sized."""

    case: Case
    error: float  # std of SP - PV, PV units
    move: float  # std of OP's moves, %
    op: np.ndarray  # OP of some records, sorted
    pace: float  # T + Td; an integrating loop's T is 1/|K Kc|, s

    @classmethod
    def of(cls, case: Case, records: list[Record]) -> Scales:
        """Measure them on records of the loop without effect."""
        plant = case["plant"]
        T = plant.get("T") or 1.0 / abs(plant["K"] * case["controller"]["Kc"])
        return cls(
            case,
            float(np.mean([np.std(r["sp"] - r["pv"]) for r in records])),
            float(np.mean([np.std(np.diff(r["op"])) for r in records])),
            np.sort(np.concatenate([r["op"] for r in records])),
            T + plant["Td"],
        )

    @property
    def noise(self) -> float:
        """Std of the noise, PV units."""
        return self.case["noise"]["std"]

    @property
    def length(self) -> float:
        """Of the record, s."""
        return self.case["n"] * self.case["Ts"]


def limits(s: Scales, side: int) -> tuple[float, float, Callable[[float], Parameters]]:
    """Return limits that cut a share x of OP's healthy range off, with the bounds of x."""
    n = len(s.op)

    def at(x: float) -> Parameters:
        cut = int((0.5 * x if side == 2 else x) * (n - 1))
        return {
            "lo": float(s.op[cut]) if side > 0 else 0.0,
            "hi": float(s.op[n - 1 - cut]) if side != 1 else 100.0,
        }

    return 0.003, 0.47, at

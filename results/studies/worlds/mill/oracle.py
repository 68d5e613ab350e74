"""How visible is an effect? Records with it against the cloud of records of the same loop without
it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from results.studies.worlds.mill.effects import build
from results.studies.worlds.mill.rig import Case
from results.studies.worlds.mill.statistics import Record, floors, measure

BANDS = {"weak": (1.3, 2.0), "medium": (2.0, 4.0), "strong": (4.0, 12.0)}
CLOUD, TRIALS = 20, 5  # records without, records with
_LOUDEST = 8  # statistics that count: those that differ most
_ENOUGH = 12.0  # spreads at which a statistic's vote ends: what shows in one alone is not strong


class Cloud(NamedTuple):
    """Records of one loop: their statistics' mean and spread, and how far one of them lies from the
    others.
    """

    mean: np.ndarray
    spread: np.ndarray
    distance: float
    records: list[Record]


def cloud(case: Case, effects: list[dict[str, Any]], seeds: list[int]) -> Cloud:
    """Run a loop under several seeds."""
    rig = build(case, effects)
    records = [rig.record(seed) for seed in seeds]
    x = np.array([_measured(case, r) for r in records])
    n = len(x)
    mean, square = x.mean(axis=0), x.var(axis=0, ddof=1)
    distances = []
    for row in x:
        others = mean + (mean - row) / (n - 1)
        left = np.maximum(square * (n - 1) - (row - mean) ** 2 * n / (n - 1), 0.0) / (n - 2)
        distances.append(_distance(row, others, np.sqrt(left)))
    return Cloud(mean, np.sqrt(square), float(np.exp(np.mean(np.log(distances)))), records)


def ratio(
    case: Case, effects: list[dict[str, Any]], seeds: list[int], without: Cloud
) -> tuple[float, list[Record]]:
    """Return how many times further than the cloud's records those with the effects lie from
    it, and the records.

    Distance = root mean square of the eight largest |x - mean| / spread (each at most 12) over some
    sixty statistics (`statistics.measure`): what shows in few of them (single samples of PV, say)
    is not drowned by the others, and what shows in one alone is not called strong.
    """
    rig = build(case, effects)
    records = [rig.record(seed) for seed in seeds]
    far = [_distance(_measured(case, r), without.mean, without.spread) for r in records]
    return float(np.exp(np.mean(np.log(far)))) / without.distance, records


def strength_of(value: float) -> str:
    """Return the word for a ratio, "" outside all bands."""
    return next((word for word, (low, high) in BANDS.items() if low <= value < high), "")


def _measured(case: Case, record: Record) -> np.ndarray:
    tuning = case["controller"]
    sign = 1.0 if tuning["direction"] == "reverse" else -1.0
    return measure(record, sign * tuning["Kc"], int(case["archive"]["op_late"]))


def _distance(x: np.ndarray, mean: np.ndarray, spread: np.ndarray) -> float:
    z = np.sort(np.minimum(np.abs(x - mean) / np.maximum(spread, floors()), _ENOUGH))
    return float(np.sqrt(np.mean(z[-_LOUDEST:] ** 2)))

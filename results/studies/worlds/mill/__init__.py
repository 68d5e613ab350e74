"""An independent world in sampled time: exact discrete plants, controllers as products sell them,
stems, an archive chain.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from results.studies.worlds.mill.drawing import Item, draw
from results.studies.worlds.mill.effects import build
from results.studies.worlds.mill.foreign import KINDS
from simbench.blind.menu import TestPlan

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "simulate", "test"]

TITLE = (
    "mill: sampled time, exact discrete plants, PLC products, pneumatic stems, faults of mills,"
    " boilers and water works"
)
FOREIGN: dict[str, str] = {name: kind.block for name, kind in KINDS.items()}


def simulate(
    answer: dict[str, Any], effects: list[dict[str, Any]], seed: int, nominal: bool = False
) -> dict[str, np.ndarray]:
    """Run the loop of a drawn record again: same statistics and set point, other load and noise,
    the given effects.
    """
    record = build(answer["case"], effects, nominal).record(seed)
    return {k: v for k, v in record.items() if answer["mv"] or k != "mv"}


def test(
    answer: dict[str, Any], effects: list[dict[str, Any]], seed: int, plan: TestPlan
) -> dict[str, np.ndarray]:
    """Run a test of the menu on the loop of a drawn record: columns as recorded, mode and lab where
    the plan has them.
    """
    case, r = dict(answer["case"]), plan.faster
    load = case["load"]
    # paces of loads are in samples, the controller's law in its scans
    case |= {
        "n": plan.n,
        "Ts": case["Ts"] / r,
        "warm": case["warm"] * r,
        "load": load | {"pace": load["pace"] * r},
    }
    rig = build(case, effects)
    rig.Kc *= plan.Kc_ratio
    rig.Ti = None if rig.Ti is None else rig.Ti / r
    columns = rig.record(seed, plan)
    return {k: v for k, v in columns.items() if answer["mv"] or plan.mv or k != "mv"}

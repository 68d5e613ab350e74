"""A world: an independent simulator that draws records with hidden effects and can run their loops again."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from detectors.plugins.registry import PluginFolder
from simbench.loop.effects import Vocabulary

WORLDS = PluginFolder(
    "world", "simbench.blind.worlds", "simbench.worlds", ("TITLE", "FOREIGN", "Item", "draw", "simulate")
)  # fmt: skip
OWN = "own"
# in this order since the first set was sealed: a seed means the same records for ever, whatever effects are added or installed
PLANNED = (
    "stiction", "deadband", "deadzone", "valve_lag", "valve_characteristic", "gain_mismatch", "time_constant_mismatch",
    "dead_time_mismatch", "extra_lag", "noise", "quantisation", "sensor_lag", "compression", "outliers", "drift",
    "oscillation", "load_steps", "load_drift", "saturation", "detuning", "error_deadband", "op_quantisation",
)  # fmt: skip
WORLD_EFFECTS = Vocabulary(PLANNED)


class Item(NamedTuple):
    """One record (columns t, sp, op, pv and mv where recorded), the baseline handed out with it, and the truth."""

    columns: dict[str, np.ndarray]
    baseline: dict[str, Any]
    answer: dict[str, Any]

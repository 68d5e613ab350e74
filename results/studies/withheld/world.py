"""The interface of an independent plant simulator: it draws records with hidden effects and can
simulate their loops again.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from simbench.loop.effects import Vocabulary

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

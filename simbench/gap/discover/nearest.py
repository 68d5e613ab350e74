"""The known effect that a law resembles most."""

from __future__ import annotations

import numpy as np

from simbench.gap.law import Law
from simbench.loop.effects import EFFECTS

_SLIPS = 0.12  # share of the band that a slip must make up for the law to look like stiction
_FLAT = 0.3  # of a curve's slope, that its flattest stretch may keep to look like a dead-zone
# forms by the number that is not at rest: the effect that acts in the same way, the likelier first
_LIKE = {
    "slowness": ("slew_limit",), "tau": ("extra_lag",), "gain": ("gain_mismatch",), "pace": ("time_constant_mismatch",),
    "delay": ("dead_time_mismatch",), "width": ("error_deadband",),
}  # fmt: skip
_FORMS = {
    "filter": ("sensor_lag",), "stairs": ("quantisation",), "limits": ("saturation",), "tuning": ("detuning",),
    "periodic": ("oscillation",), "averaged": ("averaging_archive",), "held": ("frozen_sensor",), "rough": ("noise",),
    "stops": ("travel_stop",), "derivative": ("derivative_action",), "idle": ("missed_executions",),
    "zero": ("inverse_response", "dead_time_mismatch"), "resonance": ("resonance", "extra_lag"), "pole": ("extra_lag",),
    "regime": ("gain_scheduling", "detuning"), "weight": ("detuning",), "ramps": ("slew_limit",),
}  # fmt: skip


def nearest(law: Law, op: np.ndarray) -> str | None:
    """Return the id of the known effect that a law resembles; None where none does."""
    n = law.numbers
    if law.form == "memory":
        return "stiction" if n.get("J", 0.0) > _SLIPS * n["S"] else "deadband"
    if law.form == "curve":
        slopes = np.diff(curve_of(n, np.linspace(float(op.min()), float(op.max()), 60)))
        return "deadzone" if slopes.min() < _FLAT * slopes.max() and slopes.argmin() not in (0, 58) else "valve_characteristic"
    if law.form == "rate" and n.get("tau"):
        return "valve_lag"
    names = _FORMS.get(law.form) or next((like for key, like in _LIKE.items() if n.get(key)), ())
    names = names or ("op_quantisation",) if law.form == "rest" else names
    return next((name for name in names if name in EFFECTS), None)


def curve_of(numbers: dict[str, float], u: np.ndarray) -> np.ndarray:
    """Return MV (n,) of OP `u` (n,) by the numbers of a static curve."""
    return u + sum(numbers.get(f"k{i}", 0.0) * np.maximum(u - numbers.get(f"q{i}", 50.0), 0.0) for i in (1, 2, 3))

"""The known effect that a law resembles most: by its form, and among static curves by the curve itself."""

from __future__ import annotations

import numpy as np

from simbench.gap.discover.law import Law
from simbench.gap.likelihood import kernels
from simbench.loop.effects import EFFECTS

_SLIPS = 0.12  # share of the band that a slip must make up for the law to look like stiction
_LIKE = 0.5  # of a curve's own size, that a known curve may lie beside it
# forms that are a known effect's own, or the next best word for it, the likelier first
_OWN = {
    "pole": ("extra_lag",), "filter": ("sensor_lag",), "stairs": ("quantisation",), "limits": ("saturation",),
    "tuning": ("detuning",), "periodic": ("oscillation",), "averaged": ("averaging_archive",), "held": ("frozen_sensor",),
    "stops": ("travel_stop", "saturation"), "derivative": ("derivative_action",), "idle": ("missed_executions",),
    "zero": ("inverse_response", "dead_time_mismatch"), "resonance": ("resonance", "extra_lag"), "rough": ("noise",),
    "regime": ("gain_scheduling", "detuning"),
}  # fmt: skip


def nearest(law: Law, op: np.ndarray) -> str | None:
    """Return the id of the known effect that a law resembles; None where none does."""
    n = law.numbers
    if law.form == "memory":
        return "stiction" if n.get("J", 0.0) > _SLIPS * n["S"] else "deadband"
    if law.form == "curve":
        return _by_curve(curve_of(n, op), op)
    if law.form == "size":
        return next(e for k, e in _SIZES.items() if k in n)
    if law.form == "rest":
        return "error_deadband" if n.get("width", 0.0) > 0.0 else "op_quantisation"
    if law.form == "rate":
        names = ("slew_limit",) if n.get("slowness", 0.0) > 0.0 else ("valve_lag",)
    else:
        names = _OWN.get(law.form, ())
    return next((name for name in names if name in EFFECTS), None)


_SIZES = {"gain": "gain_mismatch", "pace": "time_constant_mismatch", "delay": "dead_time_mismatch"}


def curve_of(numbers: dict[str, float], u: np.ndarray) -> np.ndarray:
    """Return MV (n,) of OP `u` (n,) by the numbers of a static curve."""
    out = np.asarray(u, dtype=float).copy()
    for i in (1, 2, 3):
        out += numbers.get(f"k{i}", 0.0) * np.maximum(u - numbers.get(f"q{i}", 50.0), 0.0)
    return out


def _by_curve(curve: np.ndarray, op: np.ndarray) -> str | None:
    """Return the known static map that is nearest to a curve over the OP of the record, offset and slope aside."""
    X = np.column_stack([np.ones(op.size), op])
    Q = np.linalg.qr(X)[0]

    def bent(v: np.ndarray) -> np.ndarray:
        return v - Q @ (Q.T @ v)

    own = bent(curve)
    size = float(np.linalg.norm(own))
    if size < 1e-3 * float(np.linalg.norm(op - op.mean())):
        return "gain_mismatch"

    def off(v: np.ndarray) -> float:
        v = bent(v)
        return float(np.linalg.norm(own - v * max(float(own @ v) / (float(v @ v) or 1.0), 0.0)))

    span, u = float(np.ptp(op)), np.ascontiguousarray(op, dtype=float)
    zones = [(D, c) for D in span * np.linspace(0.1, 0.9, 7) for c in np.quantile(op, np.linspace(0.1, 0.9, 9))]
    found = {
        "deadzone": min(off(kernels.valve(u, kernels.ZONE, D, c, 0.0)) for D, c in zones),
        "valve_characteristic": min(off(kernels.valve(u, kernels.CURVE, R, 0.0, 0.0)) for R in (0.02, 0.1, 0.3, 3.0, 10.0, 50.0)),
    }
    best = min(found, key=lambda e: found[e])
    return best if found[best] < _LIKE * size else None

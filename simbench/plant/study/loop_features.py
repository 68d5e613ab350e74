"""Describe a record by features without unit, phase or time scale, so that real and simulated loops
can be compared.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.summary_features import features

_SAMPLES = 100.0  # per period, beyond which a record counts as equally fine


def looks(record: LoopRecord) -> dict[str, float]:
    """Return the features of one record."""
    op, pv = (_unit(x) for x in (record.op, record.pv))
    sp = np.full(record.n, record.pv.mean()) if record.sp is None else record.sp
    # OP turned with PV: a direct-acting loop is a reverse one in a mirror
    turn = (
        np.sign(np.corrcoef(np.diff(op), np.diff(pv))[0, 1]) if np.ptp(op) and np.ptp(pv) else 1.0
    )
    summary = features((turn or 1.0) * op, pv, (sp - record.pv.mean()) / (np.std(record.pv) or 1.0))
    out = {k: float(v) for k, v in summary.items() if not k.endswith(" size")}
    swing = find_oscillation(record.op, record.pv, record.Ts)
    period = swing.period_s / record.Ts
    known = np.isfinite(period) and period > 0
    out["regularity"] = (
        float(np.log1p(max(swing.regularity, 0.0))) if np.isfinite(swing.regularity) else 0.0
    )
    out["samples per period"] = (
        float(np.log(min(period, _SAMPLES))) if known else float(np.log(_SAMPLES))
    )
    out["periods"] = float(np.log(record.n / period)) if known else 0.0
    out["sustained"] = float(swing.sustained)
    return {k: v if np.isfinite(v) else 0.0 for k, v in out.items()}


def by_unit(
    rows: list[dict[str, float]], units: list[str]
) -> tuple[list[str], np.ndarray, list[str]]:
    """Return features averaged over the records of a unit, so that a loop with many records counts
    once.
    """
    names, order = list(rows[0]), list(dict.fromkeys(units))
    x = np.array([[row[n] for n in names] for row in rows])
    of = np.array(units)
    return names, np.array([x[of == u].mean(axis=0) for u in order]), order


def _unit(x: np.ndarray) -> np.ndarray:
    return (x - x.mean()) / (x.std() or 1.0)

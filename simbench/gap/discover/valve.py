"""Fit an empirical model from OP to MV, if MV was recorded: fit on the first part of the record,
test on the rest.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.discover.families import KNOTS
from simbench.gap.effects import deadband, slew_limit, stiction, valve_lag
from simbench.gap.law import FoundLaw
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import size_penalty
from simbench.gap.likelihood.valve_map import MapSearch, lagged
from simbench.gap.situation import Situation

_EXPLAINS = 0.6  # share of what the baseline's valve leaves of MV, below which a law explains it


def valve_law(s: Situation, first: int) -> FoundLaw | None:
    """Return the law from OP to MV where MV was recorded and does not follow OP as the baseline's
    valve does.
    """
    if s.record.mv is None:
        return None
    op, mv, Ts = s.op, np.asarray(s.record.mv), s.record.Ts
    whole, learn, judge = (
        MapSearch(op[part], mv[part], Ts, s.expected_mv[part], s.expected_band, s.valve_lag / Ts)
        for part in (slice(None), slice(first), slice(first, None))
    )
    band, stick, rate, lag = (
        {name: float(value) for name, value in how.RECOGNISER.by_mv(learn)[1].items()}
        for how in (deadband, stiction, slew_limit, valve_lag)
    )
    knots = np.quantile(learn.op, KNOTS)
    X = np.column_stack([np.ones(op.size), op, *(np.maximum(op - q, 0.0) for q in knots)])
    slopes = np.linalg.lstsq(X[:first], learn.mv, rcond=None)[0]
    of_curve = ("q1", "q2", "q3", "k1", "k2", "k3")
    curve = dict(zip(of_curve, map(float, (*knots, *slopes[2:]))))
    tries = [
        ("memory", band, whole.moved(kernels.PLAY, band["S"], 0.0)),
        # friction is only known up to its model
        ("memory", stick, whole.moved(kernels.STICK, stick["S"], stick["J"])),
        ("memory", stick, whole.moved(kernels.CREEP, stick["S"], stick["J"])),
        ("rate", rate, kernels.slewed(op, Ts / rate["slowness"])),
        ("rate", lag, lagged(op, lag["tau"] / Ts)),
        ("curve", curve, X @ slopes),
    ]
    form, numbers, v = min(
        tries, key=lambda law: learn.level(law[2][:first]) + size_penalty(first, len(law[1]))
    )
    nats = float(judge.healthy - judge.level(v[first:]))
    most = stiction.RECOGNISER.by_mv_leaves if numbers is stick else _EXPLAINS
    return FoundLaw(form, numbers, nats) if nats > -np.log(most) * judge.op.size else None

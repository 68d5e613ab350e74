"""Fit an empirical model from OP to MV, if MV was recorded: fit on the first part of the record,
test on the rest.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects import deadband, stiction
from simbench.gap.law import FoundLaw
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.valve_map import MapSearch, lagged
from simbench.gap.situation import Situation

_EXPLAINS = 0.6  # share of what the baseline's valve leaves of MV, below which a law explains it

_Numbers = dict[str, float]


def valve_law(s: Situation, first: int) -> FoundLaw | None:
    """Return the law from OP to MV where MV was recorded and does not follow OP as the baseline's
    valve does.
    """
    if s.record.mv is None:
        return None
    op, mv, Ts = s.op, np.asarray(s.record.mv), s.record.Ts
    span, n = float(np.ptp(op)) or 1.0, op.size
    fine = 1e-3 * span

    def misfit(v: np.ndarray, where: slice) -> float:
        return float(np.sqrt(np.mean((mv - v)[where] ** 2))) + fine

    def lagging(v: np.ndarray) -> np.ndarray:
        return lagged(v, s.valve_lag / Ts, mv[0])

    learn, judge = slice(0, first), slice(first, n)
    plain = lagging(s.expected_mv)
    tries: list[tuple[str, _Numbers, np.ndarray]] = []
    search = MapSearch(
        op[learn], mv[learn], Ts, s.expected_mv[learn], s.expected_band, s.valve_lag / Ts
    )
    whole = MapSearch(op, mv, Ts, s.expected_mv)
    for module, kinds in ((deadband, (kernels.PLAY,)), (stiction, (kernels.STICK, kernels.CREEP))):
        by_mv = module.RECOGNISER.by_mv
        assert by_mv is not None
        _, p = by_mv(search)
        band = {"S": float(p["S"]), "J": float(p.get("J", 0.0))}
        # friction is only known up to its model
        tries += [
            ("memory", band, lagging(whole.moved(kind, band["S"], band["J"]))) for kind in kinds
        ]
    knots = np.quantile(op[learn], (0.25, 0.5, 0.75))
    X = np.column_stack([np.ones(n), op, *(np.maximum(op - q, 0.0) for q in knots)])
    beta = np.linalg.lstsq(X[learn], mv[learn], rcond=None)[0]
    numbers = {f"q{i + 1}": float(q) for i, q in enumerate(knots)} | {
        f"k{i + 1}": float(b) for i, b in enumerate(beta[2:])
    }
    tries.append(("curve", numbers, X @ beta))
    rates = np.geomspace(0.02, 5.0, 25) * (float(np.std(np.diff(op))) or 1.0)
    tries += [
        ("rate", {"slowness": Ts / float(rate)}, kernels.slewed(op, float(rate))) for rate in rates
    ]
    tries += [
        ("rate", {"tau": float(tau) * Ts}, lagged(op, float(tau)))
        for tau in np.geomspace(0.3, n / 20, 25)
    ]
    best = min(tries, key=lambda t: misfit(t[2], learn) * (1.0 + 0.02 * len(t[1])))
    form, numbers, v = best
    ratio = misfit(v, judge) / misfit(plain, judge)
    if not ratio < (stiction.RECOGNISER.by_mv_leaves if numbers.get("J") else _EXPLAINS):
        return None
    evidence = 0.5 * np.log(((mv - plain) ** 2 + fine**2) / ((mv - v) ** 2 + fine**2))
    return FoundLaw(form, numbers, float(-(n - first) * np.log(ratio)), evidence=evidence)

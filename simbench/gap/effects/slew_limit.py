"""Recognise a slew limit: fit the largest speed of MV, by a scan from far below the speed of OP to
beyond it.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.kernels import limit_rate
from simbench.gap.likelihood.model import Data, Fit, Free, Moves, Spec
from simbench.gap.likelihood.search import fit_likeliest, plants
from simbench.gap.likelihood.valve_map import MapFit, MapSearch


def _typical_move(d: Data) -> float:
    return float(np.std(np.diff(d.u))) or 1.0


_RATE = Free("rate", lambda d: 1e-3 * _typical_move(d), lambda d: 10.0 * _typical_move(d), log=True)


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan the rate, then refine it with the nuisances."""
    moves = Moves(lambda u, p: limit_rate(u, p["rate"], p["rate"]), (_RATE,))
    spec = base.spec.join(Spec(moves=moves))
    rates = _typical_move(engine.data) * np.geomspace(0.02, 3.0, 14)
    points = []
    for rate in rates:
        for plant in plants(engine, base):
            points.append({**plant, "rate": float(rate)})
    tries = engine.grid(spec, base.theta, points, keep=2)
    best = fit_likeliest(engine, spec, (t.theta for t in tries))
    if best.loglik > base.loglik:
        return (best, 1.0)
    return (base, 1.0)


def by_mv(search: MapSearch) -> MapFit:
    """Scan the rate finely."""
    rates = (float(np.std(np.diff(search.op))) or 1.0) * np.geomspace(0.01, 5.0, 80)
    level, best = min(
        ((search.level(limit_rate(search.op, float(r), float(r))), float(r)) for r in rates),
        key=lambda t: t[0],
    )
    return search.priced(level, {"slowness": search.Ts / best}, 1.0)


RECOGNISER = Recogniser(
    fit=fit,
    numbers=lambda fit, s: {"slowness": s.record.Ts / fit.theta["rate"]},
    by_mv=by_mv,
    needs=frozenset({"plant"}),
)

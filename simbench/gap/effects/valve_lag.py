"""Recognise a valve lag: fit one additional pole upstream of the plant, or a lag from OP to MV."""

from __future__ import annotations

import numpy as np
import scipy

from simbench.gap.effects._pole import pole, tau
from simbench.gap.effects._recogniser import NOT_IN_PLANT, Recogniser
from simbench.gap.likelihood.valve_map import MapFit, MapSearch, lag_signal


def by_mv(search: MapSearch) -> MapFit:
    """Fit the time constant from OP to MV by a scan and a refinement."""
    taus = np.geomspace(0.2, search.op.size / 10, 120)

    def level(tau: float) -> float:
        return search.level(lag_signal(search.op, tau, search.mv[0]))

    best = int(np.argmin([level(x) for x in taus]))
    around = (taus[max(best - 1, 0)], taus[min(best + 1, taus.size - 1)])
    tau = float(
        scipy.optimize.minimize_scalar(
            level, bounds=around, method="bounded", options={"xatol": 1e-3 * taus[best]}
        ).x
    )
    return search.priced(level(tau), {"tau": tau * search.Ts}, 1.0)


RECOGNISER = Recogniser(
    fit=pole("valve"),
    numbers=tau,
    by_mv=by_mv,
    needs=frozenset({"plant", NOT_IN_PLANT}),
)

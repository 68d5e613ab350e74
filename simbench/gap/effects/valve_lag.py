"""Valve lag recognised: one more series pole in front of the plant, or MV that follows OP slowly."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects import _draw
from simbench.gap.effects._pole import pole, tau
from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.likelihood.valve_map import Found, MapSearch, lagged


def by_mv(search: MapSearch) -> Found:
    """Scan the time constant finely."""
    taus = np.geomspace(0.2, search.op.size / 10, 120)
    level, best = min(((search.level(lagged(search.op, x, search.mv[0])), float(x)) for x in taus), key=lambda t: t[0])
    return search.priced(level, {"tau": best * search.Ts}, 1.0)


RECOGNISER = Recogniser(
    fit=pole("valve"),
    numbers=tau,
    by_mv=by_mv,
    needs="plant",
    smallest=lambda probe: probe.pole("valve"),
    draw=_draw.lag,
)

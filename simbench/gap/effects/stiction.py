"""Recognise stiction: fit S and J of a valve model by a fine scan, because the likelihood has
narrow peaks.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser, clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.search import band_sizes, better, promising, search_map
from simbench.gap.likelihood.valve_map import MapFit, MapSearch, friction_regressed
from simbench.gap.situation import Situation

_JUMPS = (0.06, 0.15, 0.27, 0.42, 0.6, 0.78, 0.95)  # shares J/S scanned
_COARSE_JUMPS = (0.05, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)  # the same where MV is recorded
_MODELS = (kernels.STICK, kernels.CREEP)
NUMBERS = 2.5  # S, J, and half a number for the choice between the two


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan S and J/S under two valve models: peaks are a percent or two wide, a local search misses
    them.

    Where no plant is known, only valves are tried that explain PV under a load of any spectrum as
    well: a plant that is bent to it finds friction in anything.
    """
    if not engine.data.trusted:
        S, J, stops = friction_regressed(engine.data.u, engine.data.y).valves.T
        points = np.column_stack([S, J, np.zeros(S.size)])
        tried = ((kind, points[stops == on]) for on, kind in enumerate(_MODELS))
        fits = []
        for kind, some in tried:
            if len(some):
                fits.append(search_map(engine, base, kind, some))
        return max(fits, key=lambda f: f.loglik, default=base), NUMBERS
    coarse = np.array([(s, s * j, 0.0) for s in band_sizes(engine.data, 90) for j in _JUMPS])
    best = search_map(engine, base, _MODELS[0], coarse)
    if promising(best, base):
        # where the first model is hopeless, so is the second
        best = better(best, search_map(engine, base, _MODELS[1], coarse))
    return best, NUMBERS


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return S and J (% of travel)."""
    return {name: clip(fit.theta[name], 0.0, 100.0) for name in ("S", "J")}


def by_mv(search: MapSearch) -> MapFit:
    """Return the better of two maps with a jump."""
    return max(
        (search.slipping(kind, ("S", "J"), _COARSE_JUMPS, 2.0) for kind in _MODELS),
        key=lambda t: t[0],
    )


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    # it takes the place of a valve's missing friction
    needs=frozenset({"valve without friction"}),
    by_mv=by_mv,
    band=lambda p: float(p["S"]),
)

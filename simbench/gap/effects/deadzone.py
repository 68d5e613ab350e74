"""Recognise a dead-zone: OP jumps across it, so its middle is searched where OP seldom is."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser, clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.search import band_sizes, search_map
from simbench.gap.likelihood.valve_map import MapFit, MapSearch
from simbench.gap.situation import Situation


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan width and centre, then refine."""
    centres = np.linspace(*np.quantile(engine.data.u, [0.01, 0.99]), 13)
    coarse = np.array([(s, c, 0.0) for s in band_sizes(engine.data, 12) for c in centres])
    return search_map(engine, base, kernels.ZONE, coarse), 2.0


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return width and centre (% of travel)."""
    return {name: clip(fit.theta[name], 0.0, 100.0) for name in ("D", "c")}


def by_mv(search: MapSearch) -> MapFit:
    """Scan width and centre over OP's range."""
    centres = np.quantile(search.op, np.linspace(0.05, 0.95, 13))
    return search.zoom(
        kernels.ZONE, ("D", "c"), [(s, c) for s in search.sizes for c in centres], 2.0
    )


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    by_mv=by_mv,
    needs=frozenset({"plant"}),
)

"""Recognise a nonlinear valve characteristic: a gain that changes along the travel."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Recogniser, clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.likelihood.valve_map import MapFit, MapSearch

# ratios of the largest to the smallest gain that are tried (-)
_RATIOS = (0.02, 0.05, 0.1, 0.25, 0.5, 2.0, 4.0, 10.0, 20.0, 50.0)


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Search the ratio of gains on both sides of 1, then refine."""
    spec = base.spec.join(Spec(valve=kernels.CURVE))
    points = [{"R": r} for r in _RATIOS]
    return engine.fit(spec, engine.grid(spec, base.theta, points)[0].theta), 1.0


def by_mv(search: MapSearch) -> MapFit:
    """Scan the ratio on both sides of 1."""
    ratios = tuple(np.geomspace(0.01, 0.8, 12)) + tuple(np.geomspace(1.25, 100, 12))
    return search.zoom(kernels.CURVE, ("R",), [(r, 0.0) for r in ratios], 1.0)


RECOGNISER = Recogniser(
    fit=fit,
    numbers=lambda fit, s: {"R": clip(fit.theta["R"], 0.01, 100.0)},
    by_mv=by_mv,
    needs=frozenset({"plant"}),
)

"""Recognise a dead-band: fit its width, and where in its band the valve was when the record
began.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Recogniser, clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.search import MV_STARTS, band_sizes, search_map


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan the band finely, then refine it with the nuisances."""
    coarse = np.array(
        [(s, start * s / 2, 0.0) for s in band_sizes(engine.data, 32) for start in MV_STARTS]
    )
    return search_map(engine, base, kernels.PLAY, coarse), 1.0


RECOGNISER = Recogniser(
    fit=fit,
    numbers=lambda fit, s: {"S": clip(fit.theta["S"], 0.0, 100.0)},
    by_mv=lambda search: search.zoom(kernels.PLAY, ("S",), [(s, 0.0) for s in search.sizes], 1.0),
    band=lambda p: float(p["S"]),
)

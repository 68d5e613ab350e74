"""Measure how far a record is from simulations of its baseline as it is given, each with errors
that a careful baseline may have: what a sound plant does beside it is no gap.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.closed_loop.summary_features import (
    distance,
    features,
    floor_of,
    least_spread,
    seed_spread,
)
from simbench.gap.situation import Situation
from simbench.gap.thresholds import NOMINAL
from simbench.scenarios.spec import Loop

_RUNS = 12  # simulations, each with a plant of its own
_FEWEST = 4  # of them, below which nothing is told
_STREAM = 43  # of the random numbers that draw the plants


def gap_as_given(situation: Situation, loop: Loop, seed: int = 0) -> float | None:
    """Return how many times as far the whole record is from simulations of a loop, whose gain and
    times are drawn within what a baseline may be off, as these are from each other; None where it
    cannot be simulated.
    """
    runs = []
    rng = np.random.default_rng([seed, _STREAM])
    for i in range(_RUNS):
        one = run_with_seeds(_draw_plant(loop, rng), seed + i, 1)
        if one is not None:
            op, pv = as_archived(situation, one[0].op, one[0].pv)
            runs.append(list(features(op, pv, situation.sp).values()))
    if len(runs) < _FEWEST:
        return None
    named = features(situation.op, situation.record.pv, situation.sp)
    simulated = np.array(runs)
    spread = seed_spread(simulated, least_spread(named, situation.record.n))
    away = distance(np.array(list(named.values())), simulated, spread)
    return away / max(floor_of(simulated, spread), 1e-9)


def _draw_plant(loop: Loop, rng: np.random.Generator) -> Loop:
    """Return a loop with another plant of those that its baseline may mean."""
    gain, slow, late = (1.0 + NOMINAL * rng.uniform(-1.0, 1.0, 3)).tolist()
    p = loop.plant
    if p.type == "tf":
        moved = {"plant.num": [gain * x for x in p.num or ()], "plant.Td": late * p.Td}
    else:
        moved = {"plant.K": gain * p.K, "plant.Td": late * p.Td}
        moved |= {"plant.T": slow * p.T} if p.T else {}
    return loop.with_all(moved)

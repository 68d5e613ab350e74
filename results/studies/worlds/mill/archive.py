"""The archive: a chain of stages through which each recorded signal passes, the plant knowing
nothing of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from results.studies.worlds.mill.nature import stream
from simbench.detectors.compiled import compiled

Stage = dict[str, Any]


def archived(x: np.ndarray, stages: list[Stage], seed: int) -> np.ndarray:
    """Pass a signal through the stages in their order."""
    for stage in stages:
        x = _STAGES[stage["stage"]](x, stage, stream(seed, "archive " + stage["stage"]))
    return x


def ordered(stages: list[Stage]) -> list[Stage]:
    """Return the stages in the order in which a historian has them."""
    order = list(_STAGES)
    return sorted(stages, key=lambda s: order.index(s["stage"]))


def swinging_door(x: np.ndarray, band: float) -> np.ndarray:
    """Thin x and rebuild it by straight lines that miss no sample by more than the band.

    From the last archived point a cone is kept that passes every sample since within the band; a
    sample outside the cone closes the segment at the sample before it (Bristol 1990, in the
    error-bounded form of plant historians).
    """
    if band <= 0.0:
        return x.copy()
    kept = np.flatnonzero(compiled(_door)(x, band))
    return np.interp(np.arange(len(x)), kept, x[kept])


def significant(x: np.ndarray, digits: int) -> np.ndarray:
    """Round each value to so many significant digits."""
    size = np.where(x == 0.0, 1.0, np.abs(x))
    places = digits - 1 - np.floor(np.log10(size)).astype(int)
    y = np.empty(len(x))
    for p in np.unique(places):
        y[places == p] = np.round(x[places == p], int(p))
    return y


def spikes(n: int, rate: float, size: float, rng: np.random.Generator) -> np.ndarray:
    """Return isolated one-sample errors: no two side by side, heights spread by a tenth about their
    mean, sign at random.
    """
    dice, sign, height = rng.random(n), rng.random(n) < 0.5, rng.standard_normal(n)
    # a hit is taken back where the sample before it was hit; the rate is raised for what that costs
    hit = dice < rate / max(1.0 - rate, 0.5)
    hit[1:] &= ~hit[:-1]
    return np.where(hit, np.where(sign, 1.0, -1.0) * size * (1.0 + 0.1 * height), 0.0)


def _average(x: np.ndarray, stage: Stage, rng: np.random.Generator) -> np.ndarray:
    return np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1])])


def _exception(x: np.ndarray, stage: Stage, rng: np.random.Generator) -> np.ndarray:
    if stage["band"] <= 0.0:
        return x
    kept = np.flatnonzero(compiled(_moved)(x, stage["band"]))
    return np.interp(np.arange(len(x)), kept, x[kept])


def _lattice(x: np.ndarray, stage: Stage, rng: np.random.Generator) -> np.ndarray:
    return np.round(x / stage["step"]) * stage["step"] if stage["step"] > 0.0 else x


# in the order in which a signal passes them: gateway, exception report, storage, compression, what
# is printed
_STAGES = {
    "average": _average,
    "spikes": lambda x, s, rng: x + spikes(len(x), s["rate"], s["size"], rng),
    "exception": _exception,
    "lattice": _lattice,
    "door": lambda x, s, rng: swinging_door(x, s["band"]),
    "digits": lambda x, s, rng: significant(x, s["digits"]),
    "decimals": lambda x, s, rng: np.round(x, s["decimals"]),
}


def _moved(x, band):
    """Mark the samples that an exception report sends: the first, the last, each that moved by more
    than the band.
    """
    n = len(x)
    kept = np.zeros(n, np.bool_)
    kept[0] = kept[n - 1] = True
    last = x[0]
    for i in range(1, n):
        if abs(x[i] - last) > band:
            kept[i] = True
            last = x[i]
    return kept


def _door(x, band):
    """Mark the samples that a swinging door keeps."""
    n = len(x)
    kept = np.zeros(n, np.bool_)
    kept[0] = kept[n - 1] = True
    at, low, high = 0, -np.inf, np.inf
    for i in range(1, n):
        slope = (x[i] - x[at]) / (i - at)
        if slope < low or slope > high:
            at = i - 1
            kept[at] = True
            slope = x[i] - x[at]
            low, high = slope - band, slope + band
            continue
        low = max(low, (x[i] - band - x[at]) / (i - at))
        high = min(high, (x[i] + band - x[at]) / (i - at))
    return kept

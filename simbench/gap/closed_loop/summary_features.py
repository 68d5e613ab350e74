"""Describe a record by features that do not depend on phase, so that two simulations of one loop
differ only by their seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

BANDS = 6  # octave-like bands of the spectra
_LAGS = (1, 3, 10, 30)  # samples
# added to shares whose logarithm is a feature: of samples, and of the power
REST = 0.01
PEAK = 0.001
HANN = 0.375  # mean square of the window of the spectra
CAP = 12.0  # seed-to-seed standard deviations; one absurd feature must not drown the rest
_LEAST_SPREAD = 0.03  # of a feature from seed to seed, that differences are believed to
_COUNTS = ("at rest", "straight", "at limit")


def features(op: np.ndarray, pv: np.ndarray, sp: np.ndarray) -> dict[str, Any]:
    """Return the features of one (part of a) record, or of several at once."""
    e = pv - sp
    out: dict[str, Any] = {}
    for name, x in (("pv", e), ("op", op)):
        x = x - x.mean(axis=-1, keepdims=True)
        d = np.diff(x)
        variance = np.mean(x * x, axis=-1)
        size = np.sqrt(variance) + 1e-9
        step = np.std(d, axis=-1) + 1e-9
        out[f"{name} size"] = np.log(size)
        out[f"{name} change"] = np.log(step)
        out[f"{name} kurtosis"] = np.log1p(np.mean((x * x) ** 2, axis=-1) / size**4)
        out[f"{name} change kurtosis"] = np.log1p(np.mean((d * d) ** 2, axis=-1) / step**4)
        near = size[..., None]
        out[f"{name} at rest"] = np.log(REST + np.mean(np.abs(d) < 1e-9 * near, axis=-1))
        out[f"{name} straight"] = np.log(REST + np.mean(np.abs(np.diff(d)) < 1e-6 * near, axis=-1))
        ends = (x == x.max(axis=-1, keepdims=True)) | (x == x.min(axis=-1, keepdims=True))
        out[f"{name} at limit"] = np.log(REST + np.mean(ends, axis=-1))
        n = x.shape[-1]
        power = np.abs(np.fft.rfft(x * np.hanning(n))) ** 2
        edges = np.unique(np.geomspace(2, power.shape[-1], BANDS + 1).astype(int))
        for i, (a, b) in enumerate(pairwise(edges)):
            out[f"{name} band {i + 1}"] = np.log(power[..., a:b].sum(axis=-1) / n + 1e-12)
        top = np.sort(power[..., 2:], axis=-1)[..., -3:].sum(axis=-1) / (
            power[..., 2:].sum(axis=-1) + 1e-12
        )
        out[f"{name} sharpness"] = np.log(PEAK + top)
        for lag in _LAGS:
            out[f"{name} memory {lag}"] = np.mean(x[..., lag:] * x[..., :-lag], axis=-1) / size**2
        slow = np.array([part.mean(axis=-1) for part in np.array_split(x, 5, axis=-1)])
        out[f"{name} wander"] = np.std(slow, axis=0) / size
    de = np.diff(e)
    du = np.diff(op)
    m = de.shape[-1]
    scale = np.std(de, axis=-1) * np.std(du, axis=-1) + 1e-12
    pairs = (("op after pv", de, du, (0, 1, 3)), ("pv after op", du, de, (2, 6)))
    for name, first, then, lags in pairs:
        for lag in lags:
            together = first[..., : m - lag] * then[..., lag:]
            out[f"{name} {lag}"] = np.mean(together, axis=-1) / scale
    return out


def distance(real: np.ndarray, sims: np.ndarray, spread: np.ndarray) -> float:
    """Return the mean over features of |real - mean(sims)| in seed-to-seed standard deviations,
    capped.
    """
    return float(np.minimum(np.abs(real - sims.mean(axis=0)) / spread, CAP).mean())


def least_spread(named: Mapping[str, float], samples: int) -> np.ndarray:
    """Return the smallest standard deviation that is believed of each feature of a record: of
    counted samples, what one sample more changes.
    """
    one_more = {}
    for name, x in named.items():
        if name.endswith(_COUNTS):
            one_more[name] = 1.0 / (samples * np.exp(x))
    return np.array([max(_LEAST_SPREAD, one_more.get(name, 0.0)) for name in named])


def seed_spread(sims: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Return the standard deviation of each feature from seed to seed, kept off 0."""
    return np.maximum(sims.std(axis=0, ddof=1), least)


def floor_of(sims: np.ndarray, spread: np.ndarray) -> float:
    """Return the mean distance of each seed from the others: what chance alone gives."""
    return float(_spread_of_runs(sims, spread).mean())


def chance_of(sims: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return by how much each seed's distance from the others is off the floor: what another record
    of the loop might do.
    """
    alone = _spread_of_runs(sims, spread).mean(axis=1)
    return alone - alone.mean()


def _spread_of_runs(sims: np.ndarray, spread: np.ndarray) -> np.ndarray:
    others = (sims.sum(axis=0) - sims) / (len(sims) - 1)
    return np.minimum(np.abs(sims - others) / spread, CAP)

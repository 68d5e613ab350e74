"""What a record looks like, in numbers that do not depend on its phase: two runs of one loop agree but for the seed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

BANDS = 6  # octave-like bands of the spectra
LAGS = (1, 3, 10, 30)


def features(op: np.ndarray, pv: np.ndarray, sp: np.ndarray) -> dict[str, float]:
    """Return the features of one (part of a) record.

    Parameters
    ----------
    op, pv, sp : ndarray, shape (n,)
        In % and PV units.

    Returns
    -------
    dict of str to float
        Logarithms of sizes and of band powers, correlations, and shares; no feature has a unit that a gap could hide in.
    """
    e = pv - sp
    out: dict[str, float] = {}
    for name, x in (("pv", e), ("op", op)):
        x = x - x.mean()
        d = np.diff(x)
        size, step = float(np.std(x)) + 1e-9, float(np.std(d)) + 1e-9
        out[f"{name} size"] = np.log(size)
        out[f"{name} change"] = np.log(step)
        out[f"{name} kurtosis"] = np.log1p(float(np.mean(x**4)) / size**4)
        out[f"{name} change kurtosis"] = np.log1p(float(np.mean(d**4)) / step**4)
        out[f"{name} at rest"] = np.log(0.01 + float(np.mean(np.abs(d) < 1e-9 * size)))
        out[f"{name} straight"] = np.log(0.01 + float(np.mean(np.abs(np.diff(d)) < 1e-6 * size)))
        out[f"{name} at limit"] = np.log(0.01 + float(np.mean((x == x.max()) | (x == x.min()))))
        power = np.abs(np.fft.rfft(x * np.hanning(x.size))) ** 2
        edges = np.unique(np.geomspace(2, power.size, BANDS + 1).astype(int))
        for i, (a, b) in enumerate(pairwise(edges)):
            out[f"{name} band {i + 1}"] = np.log(float(power[a:b].sum()) / x.size + 1e-12)
        top = np.sort(power[2:])[-3:].sum() / (power[2:].sum() + 1e-12)
        out[f"{name} sharpness"] = np.log(0.001 + float(top))
        for lag in LAGS:
            out[f"{name} memory {lag}"] = float(np.mean(x[lag:] * x[:-lag])) / size**2
        slow = np.array_split(x, 5)
        out[f"{name} wander"] = float(np.std([s.mean() for s in slow])) / size
    de, du = np.diff(e), np.diff(op)
    scale = (np.std(de) * np.std(du)) + 1e-12
    for lag in (0, 1, 3):
        out[f"op after pv {lag}"] = float(np.mean(de[: de.size - lag] * du[lag:])) / scale
    for lag in (2, 6):
        out[f"pv after op {lag}"] = float(np.mean(du[: du.size - lag] * de[lag:])) / scale
    return out


def as_matrix(many: list[dict[str, float]]) -> np.ndarray:
    """Return features of several runs as (runs, features)."""
    return np.array([list(f.values()) for f in many])


CAP = 12.0  # seed-to-seed standard deviations; one absurd feature must not drown the rest


def distance(real: np.ndarray, sims: np.ndarray, spread: np.ndarray) -> float:
    """Return the mean over features of |real - mean(sims)| in seed-to-seed standard deviations, capped.

    Parameters
    ----------
    real : ndarray, shape (features,)
    sims : ndarray, shape (seeds, features)
    spread : ndarray, shape (features,)

    Returns
    -------
    float
    """
    return float(np.minimum(np.abs(real - sims.mean(axis=0)) / spread, CAP).mean())


def seed_spread(sims: np.ndarray) -> np.ndarray:
    """Return the standard deviation of each feature from seed to seed, kept off 0."""
    return np.maximum(sims.std(axis=0, ddof=1), 0.03)


def floor_of(sims: np.ndarray, spread: np.ndarray) -> float:
    """Return the mean distance of each seed from the others: what chance alone gives."""
    return float(np.mean([distance(sims[i], np.delete(sims, i, axis=0), spread) for i in range(len(sims))]))

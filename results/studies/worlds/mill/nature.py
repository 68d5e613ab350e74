"""What nobody commands: loads at the plant's input, measurement noise; and the set point that
operators and cascades move.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from scipy.signal import lfilter

LOADS = ("none", "wander", "one_over_f", "rare_steps", "shot", "telegraph")
NOISES = ("white", "ar1", "heavy", "flow")
SETPOINTS = ("constant", "steps", "ramps", "cascade")


def stream(seed: int, name: str) -> np.random.Generator:
    """Return a separate random stream for each name, so that one part's draws never shift
    another's.
    """
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def load(kind: str, pace: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return a load of mean 0 and standard deviation 1."""
    if kind == "none":
        return np.zeros(n)
    if kind == "wander":
        return _wander(pace, n, rng)
    if kind == "one_over_f":
        bins = n // 2 + 1
        spectrum = rng.standard_normal(bins) + 1j * rng.standard_normal(bins)
        size = np.concatenate([[0.0], np.arange(1, bins) ** -0.5])
        return np.fft.irfft(spectrum * size, n) * n / (2.0 * np.sqrt(np.sum(size**2)))
    if kind == "rare_steps":
        return levels(1.0 / pace, n, rng)
    if kind == "shot":
        rate, keep = 0.15 / pace, np.exp(-1.0 / pace)
        pulses = rng.exponential(1.0, n) * (rng.random(n) < rate)
        # variance of filtered Poisson pulses: rate E[height^2] / (1 - keep^2), less the square of
        # the mean's share
        x = lfilter([1.0], [1.0, -keep], pulses - rate)
        return x / np.sqrt((2.0 * rate - rate**2) / (1.0 - keep**2))
    flips = rng.random(n) < 1.0 / pace
    return (-1.0) ** np.cumsum(flips) * (1.0 if rng.random() < 0.5 else -1.0)


def levels(rate: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return a level of standard deviation 1 that is drawn anew at each jump."""
    which = np.cumsum(rng.random(n) < rate)
    return rng.standard_normal(n + 1)[which]


def spells(rng: np.random.Generator, n: int, share: float, length: float) -> np.ndarray:
    """Mark a share of the samples, in spells (a two-state Markov chain)."""
    begins = min(1.0, share / max(1.0 - share, 1e-3) / length)
    gaps = rng.geometric(begins, n // 2 + 2)
    lasts = rng.geometric(min(1.0, 1.0 / length), n // 2 + 2)
    edges = np.cumsum(np.ravel(np.column_stack([gaps, lasts])))
    return np.searchsorted(edges, np.arange(n), side="right") % 2 == 1


def noise(kind: str, shape: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return measurement noise of mean 0 and standard deviation 1."""
    if kind == "heavy":
        return rng.standard_t(shape, n) / np.sqrt(shape / (shape - 2.0))
    x = rng.standard_normal(n)
    if kind == "ar1":
        return _first_order(x, shape)
    return x


def set_point(plan: dict[str, Any], t: np.ndarray) -> np.ndarray:
    """Return the set point at the times t."""
    sp = np.full(len(t), float(plan["value"]))
    for start, end, value in plan.get("moves", ()):
        share = (
            np.clip((t - start) / (end - start), 0.0, 1.0)
            if end > start
            else (t >= start).astype(float)
        )
        sp = sp + share * (value - sp)
    if "tau" in plan:
        keep = np.exp(-(t[1] - t[0]) / plan["tau"])
        x = lfilter(
            [1.0 - keep], [1.0, -keep], stream(plan["seed"], "cascade").standard_normal(len(t))
        )
        x = lfilter([1.0 - keep], [1.0, -keep], x)
        variance = (1.0 - keep) ** 4 * (1.0 + keep**2) / (1.0 - keep**2) ** 3
        sp = sp + plan["std"] * x / np.sqrt(variance)
    return sp


def _wander(pace: float, n: int, rng: np.random.Generator) -> np.ndarray:
    return _first_order(rng.standard_normal(n), float(np.exp(-1.0 / pace)))


def _first_order(x: np.ndarray, keep: float) -> np.ndarray:
    """AR(1) of variance 1 that is stationary from its first sample."""
    x = x.copy()
    x[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], x))

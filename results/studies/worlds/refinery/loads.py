"""What comes from outside: loads at the plant's input on the fine grid, measurement noise, slow
sensor error, episodes.

Every generator is a pure function of its numbers and of one random stream; several loads add up.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

LOADS = ("ou", "pink", "steps", "shot", "telegraph", "none")
NOISES = ("white", "ar1", "heavy", "flow")


def ornstein_uhlenbeck(rng: np.random.Generator, n: int, h: float, tau: float) -> np.ndarray:
    """Return n values, h s apart, of a unit-variance Ornstein-Uhlenbeck process with correlation
    time `tau` (exact).
    """
    a = np.exp(-h / tau)
    x = rng.standard_normal(n)
    x[1:] *= np.sqrt(1.0 - a * a)
    return np.asarray(lfilter([1.0], [1.0, -a], x))


def pink(rng: np.random.Generator, n: int, h: float, fastest: float) -> np.ndarray:
    """Return unit-variance noise of 1/f spectrum over five octave-and-a-half bands, the fastest of
    time `fastest` s.
    """
    return sum(ornstein_uhlenbeck(rng, n, h, fastest * 3.0**i) for i in range(5)) / np.sqrt(5.0)


def _arrivals(rng: np.random.Generator, n: int, h: float, rate: float) -> np.ndarray:
    """Return the cells (sorted, shape (m,)) in which a Poisson process of `rate` per s has its
    events.
    """
    return np.sort(rng.integers(0, n, rng.poisson(rate * n * h)))


def jumps(rng: np.random.Generator, n: int, h: float, rate: float) -> np.ndarray:
    """Return a level that is drawn anew, standard normal, at every event of a Poisson process."""
    events = _arrivals(rng, n, h, rate)
    levels = rng.standard_normal(events.size + 1)
    return levels[np.searchsorted(events, np.arange(n), side="right")]


def telegraph(rng: np.random.Generator, n: int, h: float, rate: float) -> np.ndarray:
    """Return a signal that switches between -1 and +1 at the events of a Poisson process."""
    start = rng.integers(0, 2)
    return (
        2.0
        * ((np.searchsorted(_arrivals(rng, n, h, rate), np.arange(n), side="right") + start) % 2)
        - 1.0
    )


def shot(rng: np.random.Generator, n: int, h: float, rate: float, decay: float) -> np.ndarray:
    """Return impulses of random height that die away with time `decay` (s), mean and variance 0 and
    1.
    """
    kicks = np.zeros(n)
    events = _arrivals(rng, n, h, rate)
    np.add.at(kicks, events, rng.exponential(1.0, events.size))
    x = np.asarray(lfilter([1.0], [1.0, -np.exp(-h / decay)], kicks))
    # Campbell: mean = rate decay E[height], variance = rate decay E[height^2] / 2
    return (x - rate * decay) / np.sqrt(rate * decay)


def sawtooth(
    rng: np.random.Generator, n: int, h: float, period: float, jitter: float
) -> np.ndarray:
    """Return slow build-ups from -1 to +1 with sudden ends; periods and heights scatter by the
    share `jitter`.
    """
    count = int(n * h / period * 2.0) + 8
    lengths = period * np.clip(1.0 + jitter * rng.standard_normal(count), 0.3, 2.0)
    heights = np.clip(1.0 + jitter * rng.standard_normal(count), 0.3, 2.0)
    ends = np.cumsum(lengths) - lengths[0] * rng.random()
    t = np.arange(n) * h
    i = np.minimum(np.searchsorted(ends, t, side="right"), count - 1)
    return heights[i] * (1.0 - 2.0 * np.clip((ends[i] - t) / lengths[i], 0.0, 1.0))


def gate(rng: np.random.Generator, n: int, length: float, share: float) -> np.ndarray:
    """Return a boolean (n,): episodes of about `length` cells that together cover about `share` of
    the time.
    """
    on = np.zeros(n, dtype=bool)
    at = 0.0
    quiet = length * (1.0 - share) / max(share, 1e-9)
    while at < n:
        at += quiet * rng.uniform(0.4, 1.6)
        size = length * rng.uniform(0.6, 1.4)
        on[int(min(at, n)) : int(min(at + size, n))] = True
        at += size
    return on


def ordinary(rng: np.random.Generator, n: int, h: float, spec: dict) -> np.ndarray:
    """Return the loop's load (%), shape (n,): `spec` names the kind, its times in s and its
    scale.
    """
    kind, time, rate, scale = spec["kind"], spec["time"], spec["rate"], spec["scale"]
    if kind == "none" or scale == 0.0:
        return np.zeros(n)
    if kind == "ou":
        return scale * ornstein_uhlenbeck(rng, n, h, time)
    if kind == "pink":
        return scale * pink(rng, n, h, time)
    if kind == "shot":
        return scale * shot(rng, n, h, rate, time)
    # jumps never come alone: a plant whose only load is a few steps would be a finding, not a
    # nuisance
    wandering = ornstein_uhlenbeck(rng, n, h, time)
    return scale * (
        0.8 * wandering + 0.6 * (jumps if kind == "steps" else telegraph)(rng, n, h, rate)
    )


def noise(rng: np.random.Generator, n: int, spec: dict) -> np.ndarray:
    """Return unit-variance measurement noise, shape (n,); `flow` is white here, the plant makes it
    proportional.
    """
    if spec["kind"] == "ar1":
        a, share = spec["phi"], spec.get("share", 1.0)
        x = rng.standard_normal(n)
        x[1:] *= np.sqrt(1.0 - a * a)
        x = np.asarray(lfilter([1.0], [1.0, -a], x))
        return x if share == 1.0 else share**0.5 * x + (1.0 - share) ** 0.5 * rng.standard_normal(n)
    if spec["kind"] == "heavy":
        # Student t with 6 degrees of freedom: variance 1.5; the far tail is cut so that none is a
        # spike
        return np.clip(rng.standard_t(6, n) / np.sqrt(1.5), -5.0, 5.0)
    return rng.standard_normal(n)


def wander(
    rng: np.random.Generator, n: int, h: float, rate: float, walk: float, middle: int
) -> np.ndarray:
    """Return a ramp of `rate` per s plus a random walk of `walk` per sqrt(s), both 0 at the cell
    `middle`, shape (n,).
    """
    x = rate * h * (np.arange(n) - middle)
    if walk > 0.0:
        w = np.cumsum(rng.standard_normal(n)) * walk * np.sqrt(h)
        x = x + (w - w[middle])
    return x


def spikes(rng: np.random.Generator, n: int, rate: float, size: float) -> np.ndarray:
    """Return isolated one-sample spikes, shape (n,): mean height `size`, sign at random, no two
    side by side.
    """
    hit = rng.random(n) < rate
    hit[1:] &= ~hit[:-1]
    return np.where(hit, rng.choice([-1.0, 1.0], n) * size * rng.uniform(0.5, 1.5, n), 0.0)

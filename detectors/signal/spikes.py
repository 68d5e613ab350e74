"""Find spikes, single samples that lie off the line through their neighbours, and test whether the
largest samples of a noise are outliers.
"""

from __future__ import annotations

from math import lgamma

import numpy as np

from simbench.detectors.signal.conditioning import median

_SPIKE = 6.0  # robust standard deviations from which an isolated point is a spike
_FURTHER = 4.5  # the same where three spikes are sure: 2 in 100 000 by chance
_ROUNDING = 1e-14  # share of a signal's largest value that double numbers may be off by
_ALONE = 2.0  # times the spread of its neighbours about their line; a corner has 1.5, a step 1.25


def find_spikes(x: np.ndarray, unit: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return isolated one-sample spikes.

    A spike lies off the line through its four neighbours by far more than they lie off it
    themselves (a corner, a step and a bend do not), and by far more than samples do at this time
    (those of a burst of noise do not). The largest are taken out first, so that one does not hide
    the next; where three are sure, smaller ones are believed as well.
    """
    none = np.empty(0, dtype=int), np.empty(0)
    if x.size < 20:
        return none
    outliers: dict[int, float] = {}
    clean = np.asarray(x, dtype=float).copy()
    usual = np.abs(clean - _four_neighbours(clean).mean(axis=0))
    floor = max(0.5 * unit, _ROUNDING * float(np.abs(x).max()))
    overall = max(1.4826 * median(usual), floor)
    if usual.max() <= _SPIKE * overall:
        return none
    from scipy.ndimage import maximum_filter1d, median_filter  # most records get by without

    # beyond what is usual now, at the edge of a burst of noise too
    now = maximum_filter1d(median_filter(usual, 31, mode="reflect"), 31)
    local = _FURTHER * np.maximum(1.4826 * now, floor)
    for _ in range(10):
        off, near = off_line(clean)
        size = np.abs(off)
        least = np.maximum((_SPIKE if len(outliers) < 3 else _FURTHER) * overall, local)
        hit = (size > least) & (size > _ALONE * near)
        # of spikes that touch, only the larger is sure
        new = {}
        for k in np.flatnonzero(hit & (size >= maximum_filter1d(size, 5))):
            new[int(k)] = float(off[k])
        if not new and len(outliers) >= 3:
            new = touching(clean, least)
        if not new:
            break
        for k, height in new.items():
            outliers[k] = outliers.get(k, 0.0) + height
            clean[k] -= height
    order = sorted(outliers)
    return np.array(order, dtype=int), np.array([outliers[k] for k in order])


def cleaned(x: np.ndarray, spikes: np.ndarray) -> np.ndarray:
    """Return the signal with the spikes replaced by the line between their neighbours."""
    if spikes.size == 0:
        return x
    keep = np.ones(x.size, dtype=bool)
    keep[spikes] = False
    at = np.arange(x.size)
    return np.interp(at, at[keep], x[keep])


def touching(x: np.ndarray, least: np.ndarray) -> dict[int, float]:
    """Return the heights of two spikes, one or two samples apart, each of which hides the other;
    empty when there are none.
    """
    at = np.flatnonzero(np.abs(off_line(x)[0]) > least)
    out: dict[int, float] = {}
    for k, apart, heights in sorted(
        _pairs_of_spikes(x, least, at, 1) + _pairs_of_spikes(x, least, at, 2)
    ):
        if out.keys().isdisjoint(range(k - 2, k + apart + 3)):
            out |= {k: heights[0], k + apart: heights[1]}
    return out


def _pairs_of_spikes(
    x: np.ndarray, least: np.ndarray, at: np.ndarray, apart: int
) -> list[tuple[int, int, list[float]]]:
    """Return place, distance and heights of those pairs of samples of which the first is one of
    `at`, and both are clearly off the line through the four about them.
    """
    places = np.setdiff1d(np.arange(-2, apart + 3), (0, apart))
    middle = places.mean()
    t = places - middle
    at = at[(at >= 2) & (at + apart + 2 < x.size)]
    both = at[:, None] + np.array([0, apart])
    around = x[at[:, None] + places]
    level = around.mean(axis=1, keepdims=True)
    slope = (around @ t / (t @ t))[:, None]
    heights = x[both] - level - slope * (np.array([0, apart]) - middle)
    spread = np.ptp(around - slope * t, axis=1)[:, None]
    clear = (np.abs(heights) > np.maximum(least[both], _ALONE * spread)).all(axis=1)
    return [(int(k), apart, h) for k, h in zip(at[clear], heights[clear].tolist(), strict=True)]


def off_line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far each sample is off the line through its four neighbours, and how far these
    spread about it.
    """
    around = _four_neighbours(x)
    at = np.array([-2.0, -1.0, 1.0, 2.0])[:, None]
    middle = around.mean(axis=0)
    slope = (at * around).sum(axis=0) / 10.0
    return x - middle, np.ptp(around - middle - slope * at, axis=0)


def _four_neighbours(x: np.ndarray) -> np.ndarray:
    """The four neighbours of every sample, shape (4, n); reflected oddly, a slope goes on straight
    beyond the ends.
    """
    first = 2.0 * x[0] - x[[2, 1]]
    last = 2.0 * x[-1] - x[[-2, -3]]
    padded = np.concatenate([first, x, last])
    return np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]])


# --- Test whether the largest samples of a noise belong to it or are outliers.

_DEGREES = (
    2.5,
    3.0,
    4.0,
    5.0,
    7.0,
    10.0,
)  # of freedom of Student's t that are tried for a noise with heavy tails
# of the robust variance; values that stand still would draw the mixture's core together to a point
_NARROWEST = 0.01


def heavy_tails(x: np.ndarray, most: float = 0.5) -> bool:
    """Return whether Student's t is likelier than Gaussian samples of which a share, `most` at
    most, are far wider.
    """
    # Squared samples in units of a robust standard deviation
    scale = 1.4826 * float(np.median(np.abs(x)))
    if scale == 0.0:
        return False
    z2 = (x / scale) ** 2

    # The best Student's t
    t = max(_loglik_t(z2, df) for df in _DEGREES)

    # The mixture by expectation and maximisation, from a small share of wide samples
    share = min(0.02, most)
    narrow = 1.0
    wide = float(np.quantile(z2, 0.99)) + 1.0
    far = near = z2
    for _ in range(30):
        far = share * np.exp(-0.5 * z2 / wide) / np.sqrt(wide)
        near = (1.0 - share) * np.exp(-0.5 * z2 / narrow) / np.sqrt(narrow)
        odds = far / (far + near + 1e-300)
        share = float(np.clip(odds.mean(), 1e-6, most))
        wide = max(float(odds @ z2 / max(odds.sum(), 1e-12)), narrow)
        narrow = max(float((1.0 - odds) @ z2 / (1.0 - odds).sum()), _NARROWEST)

    # Which of both is likelier
    mixture = float(np.log(far + near + 1e-300).sum()) - 0.5 * z2.size * np.log(2.0 * np.pi)
    return bool(t > mixture)


def _loglik_t(z2: np.ndarray, df: float) -> float:
    """Return the log-likelihood of Student's t at its likeliest scale."""
    variance = 1.0
    for _ in range(20):
        variance = float(np.mean((df + 1.0) * z2 / (df + z2 / variance)))
    whole = lgamma((df + 1.0) / 2) - lgamma(df / 2) - 0.5 * np.log(np.pi * df * variance)
    return float(z2.size * whole - 0.5 * (df + 1.0) * np.log1p(z2 / (df * variance)).sum())

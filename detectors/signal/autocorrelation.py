"""Compute the autocorrelation of a signal and read from it zero crossings, decay per half period
and duration.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from simbench.detectors.compiled import quick


def detrend(x: np.ndarray) -> np.ndarray:
    """Return the signal without its least-squares straight line, in units of its std; zeros for
    a constant.
    """
    return detrended(x[None])[0]


def detrended(rows: np.ndarray) -> np.ndarray:
    """Return `detrend` of every row, shape (m, n)."""
    n = rows.shape[1]
    rows = rows - np.add.reduce(rows, axis=1, keepdims=True) / n
    k, square = _straight_line(n)
    flat = rows - k * (rows @ k / square)[:, None]
    off = flat - np.add.reduce(flat, axis=1, keepdims=True) / n
    std = np.sqrt(np.add.reduce(off * off, axis=1) / n)
    # rounding leaves 1e-16 of the values: no signal
    alive = std > 1e-10 * np.abs(rows).max(axis=1)
    std[~alive] = np.inf
    return flat / std[:, None]


def centred(x: np.ndarray) -> tuple[np.ndarray, float]:
    """Return a signal less its mean, and its standard deviation, as numpy's methods do in thrice
    the time.
    """
    off = x - np.add.reduce(x) / x.size
    return off, math.sqrt(np.add.reduce(off * off) / x.size)


@lru_cache(maxsize=32)
def _straight_line(n: int) -> tuple[np.ndarray, float]:
    """Return a straight line about 0 and the sum of its squares."""
    k = np.arange(n) - 0.5 * (n - 1)
    return k, float(k @ k)


@lru_cache(maxsize=256)
def fast_size(n: int) -> int:
    """Return a length >= n for which the FFT is fast: 2, 3 or 5 times a power of two."""
    return min(m << max((-(-n // m) - 1).bit_length(), 0) for m in (2, 3, 5))


def acf(x: np.ndarray) -> np.ndarray:
    """Return the biased autocorrelation of a mean-free signal for lags below half its length, by
    FFT.
    """
    size = fast_size(x.size + x.size // 2)
    c = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: x.size // 2]
    return c / c[0]


def zero_crossings(x: np.ndarray, band: float = 0.0, most: int | None = None) -> np.ndarray:
    """Return where a signal crosses zero for good, that is, leaves the band on the other side
    before it comes back.
    """
    at = np.empty(x.size if most is None else most)
    return at[: quick(_fill_crossings)(x, band, at)]


def _fill_crossings(x, band, at):
    """Fill `at` with the places where a signal crosses zero for good, as many as there is room for;
    return their number.
    """
    # The side on which the signal was last beyond the band
    count = 0
    changes = 0
    beyond = 0
    up = x.size > 0 and x[0] > 0.0

    # samples before a change of sign, since the signal was last beyond the band
    change = np.empty(x.size, dtype=np.int64)
    for k in range(x.size):
        # a zero lies on the side of what was before, whichever way is up
        if x[k] != 0.0 and (x[k] > 0.0) != up:
            up = not up
            change[changes] = k - 1
            changes += 1
        if abs(x[k]) > band:
            side = 1 if x[k] > 0.0 else -1
            if side == -beyond:
                j = change[(changes - 1) // 2]
                at[count] = j + x[j] / (x[j] - x[j + 1])
                count += 1
                if count == at.size:
                    return count
            beyond = side
            changes = 0
    return count


def decay_ratio(rho: np.ndarray, at: np.ndarray) -> float:
    """Return R = a/b of Miao & Seborg from an ACF and its zero crossings, heights over or under the
    line between neighbours.
    """
    first = int(np.ceil(at[0]))
    second = int(np.ceil(at[1]))
    third = int(np.ceil(at[2]))
    fourth = int(np.ceil(at[3]))
    low1 = first + int(np.argmin(rho[first : second + 1]))
    top = second + int(np.argmax(rho[second : third + 1]))
    low2 = third + int(np.argmin(rho[third : fourth + 1]))
    a = rho[top] - (rho[low1] + (rho[low2] - rho[low1]) * (top - low1) / (low2 - low1))
    b = 1.0 + (rho[top] - 1.0) * low1 / top - rho[low1]
    return float(a / b)


def lasting(x: np.ndarray, period: float) -> float:
    """Return the amplitude of an oscillation in the last third of a signal over that in the first
    third.
    """
    whole = int(np.rint(period))
    half = int(np.rint(period / 2))
    power = x[whole:] * (x[:-whole] - x[whole - half : -half])
    third = power.size // 3
    if third == 0:
        return 0.0
    # summed sample by sample, so that plain and compiled give the same bits
    first = max(power[:third].cumsum()[-1] / third, 0.0)
    last = max(power[-third:].cumsum()[-1] / third, 0.0)
    if first > 0.0:
        return float(np.sqrt(last / first))
    return 1.0 if last > 0.0 else 0.0


def decay_and_lasting(rho, at, x, period):
    """Return both in one call."""
    return decay_ratio(rho, at), lasting(x, period)

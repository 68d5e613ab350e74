"""Autocorrelation of a signal and what is read from it: zero crossings, decay per half period, how long it lasts."""

from __future__ import annotations

import numpy as np


def detrend(x: np.ndarray) -> np.ndarray:
    """Return the signal without its least-squares straight line, in units of its own std; zeros for a constant.

    Examples
    --------
    >>> detrend(np.array([1.0, 2.0, 3.0]))
    array([0., 0., 0.])
    """
    x = x - x.mean()
    k = np.arange(x.size) - 0.5 * (x.size - 1)
    flat = x - k * ((k @ x) / (k @ k))
    std = flat.std()
    # rounding leaves 1e-16 of the values behind: no signal
    return flat / std if std > 1e-10 * np.abs(x).max() else np.zeros(x.size)


def fast_size(n: int) -> int:
    """Return a length >= n for which the FFT is fast: 2, 3 or 5 times a power of two.

    Examples
    --------
    >>> fast_size(6000), fast_size(1025)
    (6144, 1280)
    """
    return min(m << max((-(-n // m) - 1).bit_length(), 0) for m in (2, 3, 5))


def acf(x: np.ndarray) -> np.ndarray:
    """Return the biased autocorrelation of a mean-free signal for lags below half its length, by FFT.

    Examples
    --------
    >>> acf(np.array([1.0, -1.0, 1.0, -1.0]))
    array([ 1.  , -0.75])
    """
    size = fast_size(x.size + x.size // 2)
    c = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: x.size // 2]
    return c / c[0]


def zero_crossings(x: np.ndarray, band: float = 0.0) -> np.ndarray:
    """Return where a signal crosses zero for good, that is, leaves the band on the other side before it comes back.

    Examples
    --------
    >>> zero_crossings(np.array([1.0, 0.2, -0.2, 0.1, -1.0, -1.0, 1.0]), 0.5)
    array([2.66666667, 5.5       ])
    """
    outside = np.flatnonzero(np.abs(x) > band)
    side = x[outside] > 0
    turn = np.flatnonzero(side[1:] != side[:-1])
    before, after = outside[turn], outside[turn + 1]
    above = x > 0
    if not x.all():
        # a zero lies on the side of what was before, whichever way is up
        seen = np.maximum.accumulate(np.where(x != 0, np.arange(x.size), 0))
        above = above[seen]
    change = np.flatnonzero(above[1:] != above[:-1])
    first = np.searchsorted(change, before)
    last = np.searchsorted(change, after) - 1
    k = change[(first + last) // 2]
    return k + x[k] / (x[k] - x[k + 1])


def decay_ratio(rho: np.ndarray, at: np.ndarray) -> float:
    """Return R = a/b of Miao & Seborg from an ACF and its zero crossings.

    Examples
    --------
    >>> rho = np.cos(np.arange(200) / 8)
    >>> round(decay_ratio(rho, zero_crossings(rho)), 2)
    1.0
    """
    edges = np.ceil(at[:4]).astype(int)
    low1 = edges[0] + int(np.argmin(rho[edges[0] : edges[1] + 1]))
    top = edges[1] + int(np.argmax(rho[edges[1] : edges[2] + 1]))
    low2 = edges[2] + int(np.argmin(rho[edges[2] : edges[3] + 1]))
    a = rho[top] - np.interp(top, [low1, low2], [rho[low1], rho[low2]])
    b = np.interp(low1, [0, top], [1.0, rho[top]]) - rho[low1]
    return float(a / b)


def lasting(x: np.ndarray, period: float) -> float:
    """Return the amplitude of an oscillation in the last third of a signal over that in the first third.

    Examples
    --------
    >>> k = np.arange(900)
    >>> round(lasting(np.exp(-k / 300) * np.sin(k / 5), 10 * np.pi), 1)
    0.1
    """
    whole, half = round(period), round(period / 2)
    power = x[whole:] * (x[:-whole] - x[whole - half : -half])
    third = power.size // 3
    if third == 0:
        return 0.0
    first, last = max(power[:third].mean(), 0.0), max(power[-third:].mean(), 0.0)
    return float(np.sqrt(last / first)) if first > 0 else float(last > 0)

"""Oscillation: is there a sustained one, how regular is it, what is its period, and where is it most regular?

Three published measures on one autocorrelation function (ACF): the regularity of its zero crossings (Thornhill, Huang & Zhang 2003),
its decay ratio (Miao & Seborg 1999) and, apart from it, the integrated absolute error between crossings (Hagglund 1995).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

CROSSINGS = 11  # Thornhill 2003: the first 11 zero crossings of the ACF, 10 intervals
REGULAR = 1.0  # r > 1: the spread of the intervals is below a third of their mean
DECAY = 0.5  # R > 0.5: the ACF loses less than half of its swing per half period (Miao & Seborg 1999)
LASTING = 1.0 / 3.0  # amplitude of the last third over that of the first: below it, a transient has died out


@dataclass(frozen=True)
class Oscillation:
    """What the front end found.

    Parameters
    ----------
    sustained : bool
        An oscillation is there and lasts to the end of the record.
    regularity : float
        r = (1/3) mean(Tp) / std(Tp); above 1 = regular.
    period_s : float
        Mean period (s); NaN when none was found.
    signal : {"op", "pv", ""}
        On which of the two signals it is more regular.
    decay_ratio : float
        R of Miao & Seborg, in 0..1; NaN when the ACF has fewer than two minima.
    lasting : float
        Amplitude in the last third of the record over that in the first third.
    """

    sustained: bool
    regularity: float
    period_s: float
    signal: str = ""
    decay_ratio: float = float("nan")
    lasting: float = float("nan")


NOTHING = Oscillation(False, 0.0, float("nan"))


def find_oscillation(op: np.ndarray, pv: np.ndarray, Ts: float, sp: np.ndarray | None = None) -> Oscillation:
    """Find the sustained oscillation of a loop in OP or PV, whichever shows it more clearly.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
        Controller output and process variable, any units, either sign.
    Ts : float
        Sampling period (s).
    sp : ndarray, shape (n,), optional
        Set point; its steps are taken out of PV.

    Returns
    -------
    Oscillation
        `sustained` needs r > 1, R > 0.5 and an amplitude that lasts.

    Notes
    -----
    Source: Thornhill, Huang & Zhang (2003), J. Process Control 13, 91-100; Miao & Seborg (1999), Proc. IEEE CCA, for R.
    Not for records with several oscillations of like strength: band-pass first.

    Examples
    --------
    >>> t = np.arange(800.0)
    >>> found = find_oscillation(np.sin(t / 8), np.cos(t / 8), 1.0)
    >>> found.sustained, round(found.period_s, 1)
    (True, 50.3)
    """
    found = [
        replace(oscillation_of(x, Ts), signal=name) for name, x in (("op", op), ("pv", pv if sp is None else pv - sp))
    ]
    return max(found, key=lambda o: (o.sustained, np.isfinite(o.decay_ratio), o.regularity))


def oscillation_of(x: np.ndarray, Ts: float = 1.0) -> Oscillation:
    """Find the sustained oscillation of one signal.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Any signal; a linear trend is removed.
    Ts : float
        Sampling period (s).

    Returns
    -------
    Oscillation

    Examples
    --------
    >>> oscillation_of(np.random.default_rng(1).standard_normal(2000)).sustained
    False
    """
    x = detrend(x)
    if x.size < 8 or not x.any():
        return NOTHING
    rho = acf(x)
    at = zero_crossings(rho, 1.96 / np.sqrt(x.size))[:CROSSINGS]
    if at.size < 4:
        return NOTHING
    Tp = 2.0 * np.diff(at)
    period = float(Tp.mean())
    r = period / max(3.0 * float(Tp.std(ddof=1)), 1e-6 * period)
    R = decay_ratio(rho, at)
    lasts = lasting(x, period)
    return Oscillation(r > REGULAR and R > DECAY and lasts > LASTING, r, period * Ts, "", R, lasts)


def detrend(x: np.ndarray) -> np.ndarray:
    """Return the signal without its least-squares straight line, in units of its own std; zeros for a constant.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Any signal.

    Returns
    -------
    ndarray, shape (n,)

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


def acf(x: np.ndarray) -> np.ndarray:
    """Return the biased autocorrelation of a mean-free signal for lags 0..n/2, by FFT.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Mean-free, not all zero.

    Returns
    -------
    ndarray, shape (n // 2 + 1,)
        1 at lag 0.

    Examples
    --------
    >>> acf(np.array([1.0, -1.0, 1.0, -1.0]))
    array([ 1.  , -0.75,  0.5 ])
    """
    lags = x.size // 2 + 1
    size = 1 << (x.size + lags - 1).bit_length()
    c = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[:lags]
    return c / c[0]


def zero_crossings(x: np.ndarray, band: float = 0.0) -> np.ndarray:
    """Return where a signal crosses zero for good, that is, leaves the band on the other side before it comes back.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Mean-free signal.
    band : float
        Half width of the band of noise, >= 0, in units of x.

    Returns
    -------
    ndarray, shape (m,)
        Positions in samples, linearly interpolated; of several sign changes inside the band, the middle one.

    Examples
    --------
    >>> zero_crossings(np.array([1.0, 0.2, -0.2, 0.1, -1.0, -1.0, 1.0]), 0.5)
    array([2.66666667, 5.5       ])
    """
    outside = np.flatnonzero(np.abs(x) > band)
    side = x[outside] > 0
    turn = np.flatnonzero(side[1:] != side[:-1])
    before, after = outside[turn], outside[turn + 1]
    change = np.flatnonzero((x[1:] > 0) != (x[:-1] > 0))
    first = np.searchsorted(change, before)
    last = np.searchsorted(change, after) - 1
    k = change[(first + last) // 2]
    return k + x[k] / (x[k] - x[k + 1])


def decay_ratio(rho: np.ndarray, at: np.ndarray) -> float:
    """Return R = a/b of Miao & Seborg from an ACF and its zero crossings.

    Parameters
    ----------
    rho : ndarray, shape (m,)
        ACF from lag 0 on.
    at : ndarray, shape (>= 4,)
        Its zero crossings, in lags.

    Returns
    -------
    float
        a = height of the first maximum above the line through the first two minima, b = depth of the first minimum below the line from
        (0, 1) to that maximum. An ACF that shrinks by d per half period gives R = d.

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

    Parameters
    ----------
    x : ndarray, shape (n,)
        Mean-free signal.
    period : float
        Its period in samples.

    Returns
    -------
    float
        0 when the last third does not oscillate at this period. The squared amplitude is the mean of x(k) [x(k-P) - x(k-P/2)]: white noise
        and slow drift cancel in it.

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

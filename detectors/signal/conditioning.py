"""Remove slow drift and fast noise from an oscillating signal without shifting it in time."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np


def band(x: np.ndarray, period: float, harmonics: float) -> np.ndarray:
    """Return the oscillation alone, without drift slower than its period and without noise above a
    given harmonic.

    Not for records of less than three periods: the drift is then a guess.
    """
    return smooth(x - drift(x, period), period / harmonics)


def clear_harmonics(x: np.ndarray, period: float) -> float:
    """Return the highest harmonic of a triangle wave of this size and period that exceeds the white
    noise of the signal.

    A triangle has about var(x) / k^4 of power in its harmonic k, white noise of std s has 2 s^2 /
    period between two harmonics. Not for noise that is not white: its std is read from third
    differences.
    """
    return max((0.5 * period * float(x.var()) / max(noise_variance(x), 1e-300)) ** 0.25, 5.0)


def noise_variance(x: np.ndarray) -> float:
    """Return the variance of the white noise in a signal that is smooth but for it."""
    if x.size < 4:
        return 0.0
    # a third difference has 20 times the noise's variance; the median of a squared standard normal
    # is 0.4549
    return median(np.diff(x, 3) ** 2) / (20.0 * 0.4549)


def median(x: np.ndarray) -> float:
    """Return the median of finite numbers; `np.median` takes longer for its checks than for sorting
    the record.
    """
    k = x.size // 2
    if x.size % 2:
        return float(np.partition(x, k)[k])
    middle = np.partition(x, (k - 1, k))
    return 0.5 * float(middle[k - 1] + middle[k])


def loop_sign(op: np.ndarray, pv: np.ndarray, reach: int = 1) -> float:
    """Return -1 where PV falls when the valve opens under OP, else +1.

    Own. Not for lags beyond half a period.
    """
    change = op[2 * reach :] - op[: -2 * reach]
    middle = pv[reach:-reach]
    middle = middle - middle.mean()
    lead = change @ middle / max(float(np.linalg.norm(change) * np.linalg.norm(middle)), 1e-300)
    return -1.0 if lead > 0.1 else 1.0


def snapped(x: np.ndarray, step: float = 2.0**-23) -> np.ndarray:
    """Return a signal rounded to a step far finer than any transmitter's, so that values that
    differ only by rounding errors are equal.
    """
    return np.rint(x / step) * step


def means(x: np.ndarray, step: float) -> np.ndarray:
    """Return the means over consecutive stretches of `step` samples, which need not be a whole
    number.
    """
    if step == 1.0:
        return x
    total = np.concatenate([[0.0], np.cumsum(x)])
    return (
        np.diff(
            np.interp(step * np.arange(int(x.size / step + 1e-9) + 1), np.arange(total.size), total)
        )
        / step
    )


def band_pass(x: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the part of a signal between two frequencies, without shifting it in time.

    Source: the zero-phase filter with sharp boundaries that replaces the Wiener filter of
    Choudhury et al. (2006). Not for signals with steps: sharp boundaries ring.
    """
    line = np.linspace(x[0], x[-1], x.size)
    f = np.fft.rfftfreq(x.size)
    return np.fft.irfft(np.fft.rfft(x - line) * ((f >= low) & (f <= high)), x.size)


def drift(x: np.ndarray, period: float) -> np.ndarray:
    """Return the moving average over one period, which contains no oscillation of that period."""
    # Samples that have half a period on either side
    n = x.size
    half = min(period / 2.0, (n - 1) / 2.0)
    first = int(np.ceil(half))
    last = int(np.floor(n - 1 - half))
    if last < first:
        return np.full(n, x.mean())

    # running integral of the linearly interpolated signal, read half a period earlier and later
    total = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]))])
    inner = np.arange(first, last + 1)
    mean = (
        _integral_to(total, x, first + half, inner.size)
        - _integral_to(total, x, first - half, inner.size)
    ) / (2.0 * half)

    # At the ends the slope of the last half period goes on
    out = np.empty(n)
    out[inner] = mean
    reach = min(max(round(half), 1), mean.size - 1)
    if reach > 0:
        slopes = ((mean[reach] - mean[0]) / reach, (mean[-1] - mean[-1 - reach]) / reach)
    else:
        slopes = (0.0, 0.0)
    out[:first] = mean[0] + slopes[0] * np.arange(-first, 0)
    out[last + 1 :] = mean[-1] + slopes[1] * np.arange(1, n - last)
    return out


def smooth(
    x: np.ndarray, shortest: float, waves: Callable[[], np.ndarray] | None = None
) -> np.ndarray:
    """Return the signal without components faster than a period, with zero phase; the ends are
    continued by their mirror image.
    """
    if shortest <= 2.0:
        return x
    from scipy.fft import idct

    return np.asarray(
        idct(
            (mirrored_spectrum(x) if waves is None else waves())
            * _smoothing_taper(x.size, shortest)
        )
    )


@lru_cache(maxsize=16)
def _smoothing_taper(n: int, shortest: float) -> np.ndarray:
    """Return what smoothing leaves of each term of a mirrored spectrum."""
    ramp = np.clip((np.arange(n) / (2 * n) * shortest - 1.0) * 3.0, 0.0, 1.0)
    return 0.5 + 0.5 * np.cos(np.pi * ramp)


def mirrored_spectrum(x: np.ndarray) -> np.ndarray:
    """Return the spectrum of a signal and its mirror image after it, whose ends meet: its cosine
    transform, shape (n,).
    """
    from scipy.fft import dct

    return np.asarray(dct(x))


def _integral_to(total: np.ndarray, x: np.ndarray, start: float, count: int) -> np.ndarray:
    """Integral from sample 0 to the places start, start + 1, ..., which may be fractional."""
    if start > int(start):
        k = min(int(start), x.size - 1 - count)
    else:
        k = int(start)
    part = start - k
    here = x[k : k + count]
    if part == 0.0:
        return total[k : k + count]
    return total[k : k + count] + part * here + 0.5 * part**2 * (x[k + 1 : k + 1 + count] - here)

"""Apply a rational filter to a signal, as `scipy.signal.lfilter` does, and measure whether an
oscillation keeps its phase.

Loading scipy.signal would take two thirds of the start-up time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simbench.detectors.compiled import compiled


def lfilter(
    b: Sequence[float] | np.ndarray,
    a: Sequence[float] | np.ndarray,
    x: np.ndarray,
    before: float = 0.0,
) -> np.ndarray:
    """Filter a signal by b(z)/a(z).

    Parameters
    ----------
    b, a : sequence of float
        Numerator and denominator in z^-1, in the units of output over input; a[0] is not 0.
    x : ndarray, shape (n,)
        Input.
    before : float
        First state of the filter (`zi[0]` of scipy), in output units.

    Returns
    -------
    ndarray, shape (n,)
        Output in its own units; the samples before the first are 0 but for `before`.

    Notes
    -----
    Transposed direct form II; the bits of scipy.signal.lfilter for denominators of at least first
    order. Not for long finite responses, which a convolution by FFT gives faster.

    Examples
    --------
    >>> lfilter([1.0], [1.0, -0.5], np.array([1.0, 0.0, 0.0])).tolist()
    [1.0, 0.5, 0.25]
    """
    size = max(len(b), len(a), 2)
    both = np.zeros((2, size))
    both[0, : len(b)] = b
    both[1, : len(a)] = a
    state = np.zeros(size)
    state[0] = before
    out = np.empty(len(x))
    compiled(_filter_recursion)(
        both[0] / a[0], both[1] / a[0], np.ascontiguousarray(x, dtype=np.float64), state, out
    )
    return out


def _filter_recursion(b, a, x, state, out):
    """Fill `out`; the last of `state` stays 0."""
    last = b.size - 1
    for k in range(x.size):
        y = state[0] + b[0] * x[k]
        for i in range(1, last):
            state[i - 1] = state[i] + x[k] * b[i] - y * a[i]
        state[last - 1] = x[k] * b[last] - y * a[last]
        out[k] = y


# --- Measure whether an oscillation keeps its phase relative to another oscillation or to a
# single sine.

_WIDE = 1.35  # half width of the band around the period, as a factor
_EDGE = 0.1  # of the record at either end where a filtered phase is not trusted


def phase_locking(x: np.ndarray, y: np.ndarray, period: float) -> float:
    """Return how constant the phase between two signals is around one period (samples): 1 = locked,
    near 0 = independent.
    """
    cut = int(_EDGE * x.size)
    inner = slice(cut, x.size - cut)
    turn = np.angle(
        _analytic_signal(x, period)[inner] * np.conj(_analytic_signal(y, period)[inner])
    )
    return float(np.abs(np.exp(1j * turn).mean()))


def coherence(x: np.ndarray, period: float) -> float:
    """Return how well a swing keeps phase with one sine near a period (samples): 1 = to the end, as
    no loop does by itself.
    """
    cut = int(_EDGE * x.size)
    swing = _analytic_signal(x, period)[cut : x.size - cut]
    unit = swing / np.maximum(np.abs(swing), 1e-300)
    return float(np.abs(np.fft.fft(unit, 8 * unit.size)).max() / unit.size)


def _analytic_signal(x: np.ndarray, period: float) -> np.ndarray:
    n = x.size
    line = np.linspace(x[0], x[-1], n)
    power = np.fft.fft((x - line) * np.hanning(n) ** 0.25)
    f = np.fft.fftfreq(n)
    return np.fft.ifft(np.where((f > 1 / (_WIDE * period)) & (f < _WIDE / period), 2 * power, 0.0))

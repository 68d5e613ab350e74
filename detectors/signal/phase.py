"""Measure whether an oscillation keeps its phase relative to another oscillation or to a single
sine.
"""

from __future__ import annotations

import numpy as np

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

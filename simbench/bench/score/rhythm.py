"""How regularly a record's cycles follow each other, whatever their shape: the numbers that the
reference row `rhythm` knows in addition to those of `no_waveform`.

OP and PV are reduced to the band of their oscillation's fundamental, so that no harmonic, no corner
and no level is left; what remains is how long its cycles take, how large they are, and how their
means wander. A detector that does not cost less than `rhythm` may owe its answers to how steadily
loops swing.
"""

from __future__ import annotations

import numpy as np
import scipy.fft

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.autocorrelation import centred

# of the oscillation's frequency: where the band begins, is whole, falls, and ends. A filter with
# wider edges lets a part of the second harmonic pass, and with it the shape of the wave.
_BAND = (0.5, 0.6, 1.4, 1.5)
_LEAST = 6  # cycles of which a correlation is computed
_OF_EACH = (
    "length_spread",  # std over mean of the cycles' lengths
    "length_next",  # correlation of a cycle's length with the next one's
    "length_second",  # and with the one after that
    "size_spread",  # the same of their amplitudes
    "size_next",
    "mean_spread",  # std of the cycles' means over that of the signal
    "mean_next",  # correlation of a cycle's mean with the next one's
)
RHYTHM = (*(f"{s}_{name}" for s in ("op", "pv") for name in _OF_EACH), "means_together")


def rhythm_features(record: LoopRecord, period_s: float) -> np.ndarray:
    """Return `RHYTHM` of a record whose oscillation has a period (s); zeros where it has none."""
    period = period_s / record.Ts
    if not (np.isfinite(period) and 4.0 <= period <= record.n / 2):
        return np.zeros(len(RHYTHM))
    means = []
    values = []
    for x in (np.asarray(record.op, float), np.asarray(record.pv, float)):
        size = round(period)
        count = record.n // size
        means.append(x[: size * count].reshape(count, size).mean(axis=1))
        values += _of_signal(x, means[-1], period)
    return np.nan_to_num(np.array(values + [_correlate_neighbours(*means)]))


def _of_signal(x: np.ndarray, means: np.ndarray, period: float) -> list[float]:
    """Return `_OF_EACH` of one signal."""
    # The fundamental, and where it rises through zero
    off, std = centred(x)
    fundamental = _band_of_period(off, period)
    before = np.flatnonzero((fundamental[:-1] < 0.0) & (fundamental[1:] >= 0.0))
    if before.size < 3 or not std > 0.0:
        return [0.0] * len(_OF_EACH)

    # Lengths and sizes of the cycles
    a = fundamental[before]
    b = fundamental[before + 1]
    lengths = np.diff(before + a / (a - b))
    sizes = np.maximum.reduceat(np.abs(fundamental), before + 1)[:-1]

    # How much they vary, and whether neighbours vary alike
    return [
        _relative_spread(lengths),
        _correlate_next(lengths),
        _correlate_next(lengths, 2),
        _relative_spread(sizes),
        _correlate_next(sizes),
        centred(means)[1] / std,
        _correlate_next(means),
    ]


def _relative_spread(x: np.ndarray) -> float:
    mean = np.add.reduce(x) / x.size
    if mean > 0.0:
        return float(centred(x)[1] / mean)
    return 0.0


def _correlate_next(x: np.ndarray, step: int = 1) -> float:
    return _correlate_neighbours(x[:-step], x[step:])


def _correlate_neighbours(x: np.ndarray, y: np.ndarray) -> float:
    if x.size < _LEAST:
        return 0.0
    x, x_std = centred(x)
    y, y_std = centred(y)
    if x_std > 0.0 and y_std > 0.0:
        return float(x @ y / (x.size * x_std * y_std))
    return 0.0


def _band_of_period(x: np.ndarray, period: float) -> np.ndarray:
    """Return what of a signal oscillates with about the period (samples), without delay."""
    # a cosine transform is the spectrum of the signal and its mirror image at half the cost
    frequency = np.arange(x.size) * (0.5 * period / x.size)
    gain = np.interp(frequency, _BAND, (0.0, 1.0, 1.0, 0.0))
    spectrum = np.asarray(scipy.fft.dct(x))
    return np.asarray(scipy.fft.idct(gain * spectrum))

"""Bicoherence test for nonlinearity: measure whether pairs of frequencies in a signal drive their
sum; gives the indices NGI and NLI.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from simbench.detectors.signal.conditioning import means

_SEGMENT = 128  # samples per segment, half overlapping
_FEWEST = 4  # segments in a record
_FLOOR = 1e-4  # of the mean power: frequencies below it are rounding or leakage, not signal
# published limits, Choudhury, Shah & Thornhill (2004)
NGI_LOW = 0.001
NLI_LOW = 0.01
_OF_CYCLES = 64  # samples per segment of an oscillation, as its authors have them
# a segment then holds three cycles, the least that Jelali asks for
_SAMPLES_PER_CYCLE = _OF_CYCLES / 3.0
LOWEST = 0.004  # boundary of the filter, in cycles per sample
BESIDE = 0.05  # distance of either boundary from the peak, in cycles per sample


@dataclass(frozen=True)
class _Bicoherence:
    """Squared bicoherence over the principal triangle and what follows from it."""

    bic2: np.ndarray  # 0..1, shape (m,)
    f1: np.ndarray  # its two frequencies, cycles per sample, f2 <= f1, f1 + f2 < 1/2, shape (m,)
    f2: np.ndarray
    segments: int  # averaged; a linear Gaussian signal gives bic2 of about 1/segments
    # mean bic2 less its 95 % bound for a linear Gaussian signal of independent values; window and
    # overlap make neighbours alike, so that a fifth of all linear signals exceed it. The published
    # limit is above it.
    ngi: float
    # largest bic2 less (mean + 2 std): large when a few frequency pairs stand out, small again when
    # nearly all do
    nli: float
    # largest bic2 over the value that it exceeds in 5 % of linear Gaussian signals of this length
    height: float

    def nonlinear(self, ngi_low: float = NGI_LOW, nli_low: float = NLI_LOW) -> bool:
        """Whether the signal is nonlinear by the published limits, or by others."""
        return self.ngi > ngi_low and self.nli > nli_low

    @property
    def peak(self) -> tuple[float, float]:
        """Frequencies (f1, f2) of the largest squared bicoherence, cycles per sample."""
        k = int(np.argmax(self.bic2))
        return float(self.f1[k]), float(self.f2[k])


def boundaries(peak: tuple[float, float]) -> tuple[float, float]:
    """Return the filter boundaries of Procedure 11.3, step 2, about two frequencies (cycles per
    sample).
    """
    return max(LOWEST, min(peak) - BESIDE), min(0.5, max(peak) + BESIDE)


def bicoherence(x: np.ndarray, segment: int = _SEGMENT) -> _Bicoherence:
    """Estimate the squared bicoherence of a signal by averaging over half-overlapping segments.

    Source: Choudhury, Shah & Thornhill (2004), Automatica 40, 1719-1728: bic2 = |E X1 X2 X12*|^2 /
    (E|X1 X2|^2 E|X12|^2). For a linear Gaussian signal 2 K bic2 is chi-squared with 2 degrees of
    freedom: mean 1/K, std 1/K, the largest of m values about ln(m)/K. Bounds that 5 % of such
    signals exceed whatever their length detected fewer sticky loops than the published limits, and
    were right less often.
    Not for symmetric cycles: half-wave symmetry leaves odd harmonics only, whose sums are even, and
    nothing shows.
    """
    # Half-overlapping segments under a window, without their means
    i, j = _principal_triangle(segment)
    hop = segment // 2
    pieces = np.lib.stride_tricks.sliding_window_view(x, segment)[::hop]
    pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * _hann_window(segment)

    # sixth powers of the record's numbers leave the range of doubles; a power of two changes no bit
    # of the ratios
    pieces = np.ldexp(pieces, -np.frexp(np.abs(pieces).max())[1])

    # Products of the spectra over the principal triangle
    X = np.fft.rfft(pieces, axis=1).T
    K = X.shape[1]
    product = X[i] * X[j]
    joint = np.einsum("mk,mk->m", product, X[i + j].conj())
    power = np.einsum("mk,mk->m", product.real, product.real) + np.einsum(
        "mk,mk->m", product.imag, product.imag
    )

    # The squared bicoherence, with a floor where there is no power
    single = (X.real**2 + X.imag**2).sum(axis=1)
    floor = _FLOOR * single.mean()
    bic2 = np.abs(joint) ** 2 / np.maximum((power + floor**2 / K) * (single[i + j] + floor), 1e-300)

    # The indices of the chapter: the mean above its bound, and the peak above the mean
    m = bic2.size
    mean = float(bic2.mean())
    ngi = mean - (1.96 + np.sqrt(4.0 * m - 1.0)) ** 2 / (4.0 * K * m)
    top = float(bic2.max())
    nli = top - mean - 2.0 * float(bic2.std())
    return _Bicoherence(
        bic2, i / segment, j / segment, K, float(ngi), nli, float(top * K / (np.log(m) + 2.97))
    )


def error_bicoherence(e: np.ndarray, period: float) -> _Bicoherence | None:
    """Estimate the bicoherence of a control error, resampled so that a segment of 64 samples holds
    three cycles.

    Source: segments of 64 as in Choudhury, Shah & Thornhill (2004); Jelali (2013), section 11.7.2:
    down-sampled in such a way that the FFT length holds at least 3 or 4 cycles. None for less than
    twelve cycles. Not for signals whose nonlinearity shows above half the frequency of the new
    samples.
    """
    step = resampling_step(period)
    x = means(e, step)
    if x.size < _FEWEST * _OF_CYCLES:
        return None
    result = bicoherence(x, _OF_CYCLES)
    return replace(result, f1=result.f1 / step, f2=result.f2 / step)


def resampling_step(period: float) -> float:
    """Return how many samples become one, so that a cycle of `period` samples has no more than its
    authors' records have.
    """
    if np.isfinite(period):
        return max(1.0, period / _SAMPLES_PER_CYCLE)
    return 1.0


@lru_cache(maxsize=4)
def _principal_triangle(segment: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequency bins (i, j) of the principal triangle, 0 < j <= i, i + j < segment / 2."""
    i, j = np.meshgrid(np.arange(1, segment // 2), np.arange(1, segment // 2), indexing="ij")
    inside = (j <= i) & (i + j < segment // 2)
    return i[inside], j[inside]


@lru_cache(maxsize=4)
def _hann_window(segment: int) -> np.ndarray:
    return 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)

"""Bicoherence: the fast triangle against its definition, what noise gives, and what it can and
cannot see.
"""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.signal.bicoherence import bicoherence


def naive(x, L):
    """Squared bicoherence by its definition, one pair of frequencies and one segment at a time."""
    hann = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(L) / L)
    spectra = []
    for start in range(0, len(x) - L + 1, L // 2):
        piece = x[start : start + L]
        spectra.append(np.fft.fft((piece - piece.mean()) * hann))
    out = {}
    for i in range(1, L // 2):
        for j in range(1, i + 1):
            if i + j < L // 2:
                joint = sum(X[i] * X[j] * np.conj(X[i + j]) for X in spectra)
                both = sum(abs(X[i] * X[j]) ** 2 for X in spectra)
                single = sum(abs(X[i + j]) ** 2 for X in spectra)
                out[i, j] = abs(joint) ** 2 / (both * single)
    return out


def test_fast_triangle_equals_the_definition():
    x = np.random.default_rng(0).standard_normal(600)
    result = bicoherence(x, 64)
    slow = naive(x, 64)
    assert result.segments == 17
    assert result.bic2.size == len(slow)
    for value, f1, f2 in zip(result.bic2, result.f1, result.f2, strict=True):
        assert value == pytest.approx(slow[round(f1 * 64), round(f2 * 64)], rel=2e-3)


def test_noise_is_called_nonlinear_in_at_most_five_percent():
    rng = np.random.default_rng(1)
    results = [bicoherence(rng.standard_normal(4096)) for _ in range(200)]
    assert np.mean([f.nonlinear() for f in results]) < 0.06
    # its values are not independent, as the source has them
    assert 0.15 < np.mean([f.ngi > 0 for f in results]) < 0.30
    assert np.mean([f.height > 1 for f in results]) < 0.10
    assert np.mean([f.bic2.mean() * f.segments for f in results]) == pytest.approx(1.02, abs=0.02)
    assert np.mean([np.mean(f.bic2 > 3.0 / f.segments) for f in results]) == pytest.approx(
        0.05, abs=0.005
    )


def test_peak_lies_at_the_coupled_pair():
    rng = np.random.default_rng(2)
    t = np.arange(8192)
    # phases that wander, so that only the coupling is common to all segments
    a, b = (2 * np.pi * f * t + np.cumsum(0.05 * rng.standard_normal(t.size)) for f in (0.20, 0.11))
    x = np.cos(a) + np.cos(b) + np.cos(a + b) + 0.3 * rng.standard_normal(t.size)
    result = bicoherence(x)
    assert result.height > 1
    assert result.peak == pytest.approx((0.20, 0.11), abs=0.012)
    free = np.cos(a) + np.cos(b) + np.cos(a + b + np.cumsum(0.2 * rng.standard_normal(t.size)))
    assert bicoherence(free + 0.3 * rng.standard_normal(t.size)).height < result.height / 3


def test_linear_answer_notes_that_it_rules_nothing_out(loop):
    verdict = judge(loop(n=3000, noise=0.05), ["bicoherence"])[0]
    assert verdict.verdict == "no_stiction"
    assert "symmetric cycle would not show" in verdict.reason

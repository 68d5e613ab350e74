"""Half cycles and the shapes fitted to them, against fits done one by one."""

import numpy as np
import pytest
from scipy.optimize import curve_fit, minimize_scalar

from simbench.detectors.signal import half_cycles as h

RNG = np.random.default_rng(21)
POINT = (np.arange(h.HALF_CYCLE_POINTS) + 0.5) / h.HALF_CYCLE_POINTS
SINE, TRIANGLE, SQUARE = (
    np.sin(np.pi * POINT),
    np.minimum(POINT, 1 - POINT),
    np.ones(h.HALF_CYCLE_POINTS),
)


def naive_sine(hump):
    """Non-linear least squares as in the paper, started at the peak and at one half period."""

    def sine(t, A, w):
        return A * np.sin(w * t)

    best, _ = curve_fit(sine, POINT, hump, p0=(hump.max(), np.pi))
    return float(((hump - sine(POINT, *best)) ** 2).mean())


def naive_triangle(hump):
    def error(apex):
        shape = np.minimum(POINT / apex, (1 - POINT) / (1 - apex))
        return float(((hump - shape * (shape @ hump) / (shape @ shape)) ** 2).mean())

    grid = np.linspace(0.02, 0.98, 200)
    start = min(grid, key=error)
    return minimize_scalar(
        error, bounds=(max(start - 0.01, 0.02), min(start + 0.01, 0.98)), method="bounded"
    ).fun


def naive_two_lines(hump):
    top, error = int(hump.argmax()), 0.0
    for part in (slice(0, top + 1), slice(top, None)):
        line = np.polyval(np.polyfit(POINT[part], hump[part], 1), POINT[part])
        error += ((hump[part] - line) ** 2).sum()
    return error / hump.size


def humps(count=12):
    """Between sine, triangle and square, leaning, and noisy."""
    mixed = [a * SINE + b * 2 * TRIANGLE + 0.3 * c * SQUARE for a, b, c in RNG.random((count, 3))]
    return np.array(
        [
            x * (1 + 0.5 * (POINT - 0.5)) + 0.02 * RNG.standard_normal(h.HALF_CYCLE_POINTS)
            for x in mixed
        ]
    )


def test_sine_misfit_equals_the_nonlinear_fit():
    data = humps()
    for one, hump in zip(h.misfit(data, h.sines()), data, strict=True):
        assert one == pytest.approx(naive_sine(hump), rel=0.05, abs=2e-5)


def test_triangle_misfit_equals_the_scan_of_the_apex():
    data = humps()
    for one, hump in zip(h.misfit(data, h.triangles()), data, strict=True):
        assert one == pytest.approx(naive_triangle(hump), rel=0.05, abs=2e-5)


def test_two_line_misfit_equals_two_straight_fits():
    data = humps()
    assert np.allclose(h.two_line_misfit(data), [naive_two_lines(x) for x in data], rtol=1e-6)


def test_flipped_signal_has_the_same_half_cycles():
    x = np.sin(np.arange(500) / 9) + 0.1 * RNG.standard_normal(500)
    assert np.array_equal(h.split(x, 56.5), h.split(-x, 56.5))


def test_peak_areas_are_the_areas():
    for apex in (0.2, 0.37, 0.5, 0.83):
        hump = np.minimum(POINT / apex, (1 - POINT) / (1 - apex))
        before, after = h.peak_areas(hump[None])
        assert before[0] == pytest.approx(0.5 * apex, abs=0.7 / h.HALF_CYCLE_POINTS)
        assert before[0] + after[0] == pytest.approx(0.5, abs=1e-3)
    for w in (0.8, 1.0, 1.2):
        before, _ = h.peak_areas(np.sin(w * np.pi * POINT)[None])
        peak = min(0.5 / w, 1.0)
        assert before[0] == pytest.approx((1 - np.cos(w * np.pi * peak)) / (w * np.pi), rel=2e-3)

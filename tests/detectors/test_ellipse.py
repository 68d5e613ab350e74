"""Ellipse fit: width against geometry, an independent library, and the verdicts of methods ellipse
and choudhury.
"""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.ellipse import fit_ellipse

RNG = np.random.default_rng(0)


def points(a, b, alpha, x0=0.0, y0=0.0, n=60):
    t = RNG.uniform(0, 2 * np.pi, n)
    x, y = a * np.cos(t), b * np.sin(t)
    return x0 + x * np.cos(alpha) - y * np.sin(alpha), y0 + x * np.sin(alpha) + y * np.cos(alpha)


def test_width_equals_geometry_on_200_random_ellipses():
    for _ in range(200):
        b, a = np.sort(RNG.uniform(0.2, 5.0, 2))
        alpha = RNG.uniform(-np.pi / 2, np.pi / 2)
        ellipse = fit_ellipse(*points(a, b, alpha, *RNG.normal(0, 30, 2)))
        width = 2 * a * b / np.sqrt((a * np.sin(alpha)) ** 2 + (b * np.cos(alpha)) ** 2)
        assert ellipse.apparent_stiction == pytest.approx(width, abs=1e-9)
        assert ellipse.axes[:2] == pytest.approx((a, b), abs=1e-9)
        assert np.sin(ellipse.axes[2] - alpha) == pytest.approx(0, abs=1e-6)


def test_width_is_the_published_formula_with_its_root():
    assert fit_ellipse(*points(3.0, 1.0, 0.6)).apparent_stiction == pytest.approx(
        3.184214187, abs=1e-8
    )


def test_width_scales_with_op_alone():
    x, y = points(3.0, 1.0, 0.6)
    x, y = x + RNG.normal(0, 0.05, x.size), y + RNG.normal(0, 0.05, x.size)
    plain, scaled = fit_ellipse(x, y), fit_ellipse(7 * x + 3, -40 * y + 9)
    assert scaled.apparent_stiction == pytest.approx(7 * plain.apparent_stiction, rel=1e-9)
    assert scaled.fitness(7 * x + 3, -40 * y + 9) == plain.fitness(x, y)


@pytest.mark.parametrize("slope", [1.0, -2.0, 0.0])
def test_points_on_a_line_are_no_ellipse(slope):
    x = np.linspace(0, 1, 50)
    assert fit_ellipse(x, slope * x + 3) is None


def cycle(phase, harmonic=0.0, n=6000, noise=0.02):
    t = 2 * np.pi * np.arange(n) / 40 + 0.02 * np.cumsum(
        np.random.default_rng(1).standard_normal(n)
    )
    rng = np.random.default_rng(2)
    op = np.sin(t) + harmonic * np.cos(2 * t)
    pv = np.sin(t - phase) + harmonic * np.sin(2 * (t - phase)) + noise * rng.standard_normal(n)
    return LoopRecord(50 + op, pv, 1.0, process="self-regulating")


def test_choudhury_warns_when_op_moves_over_a_quarter_of_its_span():
    record = cycle(np.pi / 2, harmonic=0.06)
    wide = judge(replace(record, op=20 * (record.op - 50) + 50), ["choudhury"])[0]
    assert wide.verdict == "stiction"
    assert "look at the valve's characteristic" in wide.reason
    assert "characteristic" not in judge(record, ["choudhury"])[0].reason

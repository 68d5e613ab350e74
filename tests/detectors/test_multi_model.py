"""The two multi-model methods: jumps against every possible course, filters against the exact
likelihood.
"""

import itertools

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods import horch_isaksson, stenman
from simbench.detectors.methods.horch_isaksson import LOOSE, two_models
from simbench.detectors.methods.stenman import best_jumps
from simbench.detectors.signal.fits.arx import fit_plant, fit_plant_by_columns


def test_jumps_are_the_cheapest_of_all_courses():
    rng = np.random.default_rng(0)
    for _ in range(20):
        u, r = rng.standard_normal((2, 9))
        penalty = rng.uniform(0.05, 1.0)

        def price(course, u=u, r=r, penalty=penalty):
            x = np.empty(9)
            for k in range(9):
                x[k] = u[k] if k == 0 or course[k - 1] else x[k - 1]
            return float(np.sum((r - x) ** 2) + penalty * sum(course)), x

        cheapest = min((price(c) for c in itertools.product((0, 1), repeat=8)), key=lambda f: f[0])
        assert np.allclose(best_jumps(u, r, penalty), cheapest[1])


def test_jumps_of_a_long_record_equal_the_plain_kernel_bit_for_bit():
    rng = np.random.default_rng(5)
    u = np.cumsum(rng.standard_normal(90))
    r = np.repeat(u[::9], 9) + 0.3 * rng.standard_normal(90)
    plain = np.empty(90)
    stenman._follow_jumps(u, r, 0.4, plain)
    assert np.array_equal(best_jumps(u, r, 0.4), plain)


@pytest.mark.parametrize("hold", [1, 7])
def test_plant_by_normal_equations_equals_that_by_columns(hold):
    rng = np.random.default_rng(hold)
    x = np.repeat(rng.standard_normal(400 // hold), hold)
    y = np.cumsum(rng.standard_normal(x.size)) * 0.1 + x
    assert fit_plant(x, y, range(9)) == pytest.approx(
        fit_plant_by_columns(x, y, range(9)), rel=1e-9
    )


def test_a_valve_that_rests_has_the_plant_of_the_columns():
    y = np.random.default_rng(6).standard_normal(200)
    for x in (np.full(200, 0.7), np.full(200, 1e8)):
        assert fit_plant(x, y, range(4)) == fit_plant_by_columns(x, y, range(4))


def test_filters_equal_the_plain_kernel_bit_for_bit():
    u, y = np.random.default_rng(7).standard_normal((2, 150))
    plain = np.empty(150)
    total = horch_isaksson._filter_samples(u, y, 0.8, 0.3, 0.2, 0.95, plain)
    standing, likelihood = two_models(u, y, 0.8, 0.3, 0.2)
    assert np.array_equal(standing, plain)
    assert likelihood == total


def test_following_valve_alone_has_the_exact_likelihood():
    rng = np.random.default_rng(2)
    n, a, b, noise = 12, 0.7, 0.4, 0.3
    u, y = rng.standard_normal((2, n))
    # y is Gaussian: z(0) = y(0) + r-noise, v(0) = u(0) + q, then v(k+1) = u(k) + q, z(k+1) = a z(k)
    # + b v(k+1)
    mean, jac = np.empty(n), np.zeros((n, n + 1))
    z, row = y[0], np.zeros(n + 1)
    row[0] = noise
    for k in range(n):
        mean[k], jac[k] = z, row
        row = a * row
        row[k + 1] = b * LOOSE
        z = a * z + b * u[k]
    C = jac @ jac.T + noise**2 * np.eye(n)
    left = y - mean
    exact = -0.5 * (left @ np.linalg.solve(C, left) + np.linalg.slogdet(2 * np.pi * C)[1])
    assert two_models(u, y, a, b, noise, 1.0)[1] == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("name", ["stenman", "horch_isaksson"])
def test_sticky_loop_scores_far_above_a_sine_from_outside(name, loop):
    sticky = judge(loop(J=5.0, kick=6.0, n=2000, noise=0.05), [name])[0]
    load = 3 * np.sin(2 * np.pi * np.arange(2000) / 60)
    healthy = judge(loop(S=0.0, J=0.0, load=load, n=2000, noise=0.05), [name])[0]
    assert sticky.verdict == "stiction"
    assert healthy.verdict != "stiction"
    assert sticky.score > healthy.score + 0.1

"""The regressions of the law, on errors whose law is known."""

import numpy as np
import pytest

from simbench.gap.controller.law import (
    about_zero,
    by_steps,
    spread,
)

N = 2000
E = np.cumsum(np.random.default_rng(0).normal(0.0, 0.3, N)) * 0.2
KC, KI = 0.8, 0.05
ROWS = np.ones(N - 1, dtype=bool)


def steps(extra, base=(KC, KI)):
    du = (KC + KI) * E[1:] - KC * E[:-1]
    size = spread(du)
    return by_steps(du + size * extra, E, ROWS, *base, size, False)


def test_robust_sizes_are_standard_deviations_of_gaussian_samples():
    x = np.random.default_rng(1).normal(3.0, 2.0, 20_000)
    assert spread(x) == pytest.approx(2.0, rel=0.03)
    assert about_zero(x - 3.0) == pytest.approx(2.0, rel=0.03)
    assert spread(np.empty(0)) == 0.0


def test_an_exact_law_and_another_tuning_are_distinguished():
    fit = steps(np.zeros(N - 1))
    assert (fit.a, fit.b) == pytest.approx((KC + KI, -KC))
    assert max(fit.residual, fit.base) < 1e-9
    assert steps(np.zeros(N - 1), base=(2 * KC, KI)).base > 0.3


@pytest.mark.parametrize(
    ("form", "share"), [("backward", 1.0), ("trapezoid", 0.5), ("forward", 0.0)]
)
def test_every_way_to_integrate_is_the_baselines(form, share):
    du = KC * np.diff(E) + KI * (share * E[1:] + (1.0 - share) * E[:-1])
    assert by_steps(du, E, ROWS, KC, KI, spread(du), False).base < 1e-9

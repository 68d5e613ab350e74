"""What OP shows of the PV before an archive, over the range of integral times."""

import numpy as np
import pytest

from simbench.gap.controller.recovered_pv import hidden_law, recover_pv

N = 1500
E = np.random.default_rng(0).normal(0.0, 1.0, N)


def op_of(a, b):
    return 50.0 + np.append(0.0, np.cumsum(a * E[1:] + b * E[:-1]))


@pytest.mark.parametrize("ratio", [1 / 16, 0.3, 1.0, 4.0, 16.0])
def test_an_integral_time_is_fitted_from_a_twentieth_to_twenty_times_the_baselines(ratio):
    Kc, wait = 0.8, 40.0
    a, b = Kc * (1.0 + 1.0 / (wait * ratio)), -Kc
    exact = np.arange(N) % 7 == 0
    fit = hidden_law(op_of(a, b), E, 0.5, 0.5 / wait, exact)
    assert (fit.a, fit.b) == pytest.approx((a, b), rel=1e-3)
    assert fit.misfit < 1e-3
    assert fit.base > 0.1


def test_a_proportional_controllers_gain_is_fitted():
    fit = hidden_law(50.0 + 1.7 * E, E, 1.0, 0.0, np.arange(N) % 5 == 0)
    assert (fit.a, fit.b, fit.misfit) == pytest.approx((1.7, -1.7, 0.0), abs=1e-6)
    assert fit.base == pytest.approx(0.7, rel=0.1)


def test_a_law_that_cannot_be_inverted_recovers_nothing():
    op, inside = op_of(1.0, -0.9), np.ones(N, dtype=bool)
    for a, b in ((0.0, -1.0), (1.0, 0.1), (1.0, -1.0)):
        assert recover_pv(op, E, -E, inside, a, b, False) is None
    assert recover_pv(op, E, -E, inside, 1.0, -0.999, False) is not None
    assert recover_pv(50.0 + 2.0 * E, E, -E, inside, 2.0, -2.0, True) == pytest.approx(-E, abs=0.1)

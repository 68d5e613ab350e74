"""What OP shows of the PV before an archive: laws over the whole range of integral times, means and
what is none.
"""

import numpy as np
import pytest

from simbench.gap.controller.recovered_pv import hidden_law, recover_pv, rest_of_mean

N = 1500
E = np.random.default_rng(0).normal(0.0, 1.0, N)
SEEN = np.random.default_rng(1).normal(size=4000)


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


@pytest.mark.parametrize("limited", [[], [0], [300, 301, 302, 900]])
def test_the_error_that_made_op_is_recovered_between_the_limits(limited):
    a, b = 0.85, -0.8
    inside = np.ones(N, dtype=bool)
    inside[limited] = False
    archived = np.round(20.0 - E)
    seen = recover_pv(op_of(a, b), 20.0 - archived, archived, inside, a, b, False)
    assert seen is not None
    off = np.abs(seen - (20.0 - E))
    # the first error of a stretch is the archive's, and is forgotten by 0.8/0.85 a sample
    assert off[250:300].max() < 1e-5
    assert off[650:900].max() < 1e-5
    if limited:
        assert seen[limited].tolist() == archived[limited].tolist()


def test_a_law_that_cannot_be_inverted_recovers_nothing():
    op, inside = op_of(1.0, -0.9), np.ones(N, dtype=bool)
    for a, b in ((0.0, -1.0), (1.0, 0.1), (1.0, -1.0)):
        assert recover_pv(op, E, -E, inside, a, b, False) is None
    assert recover_pv(op, E, -E, inside, 1.0, -0.999, False) is not None
    assert recover_pv(50.0 + 2.0 * E, E, -E, inside, 2.0, -2.0, True) == pytest.approx(-E, abs=0.1)


@pytest.mark.parametrize(
    ("weights", "mean"),
    [
        ((0.5, 0.5), True),
        ((0.54, 0.54), True),
        ((0.57, 0.57), False),
        ((0.46, 0.46), True),
        ((0.43, 0.43), False),
        ((1.15, -0.15), True),
        ((1.25, -0.25), False),
    ],
)
def test_the_weights_of_a_mean_add_to_one_and_are_hardly_negative(weights, mean):
    pv = weights[0] * SEEN + weights[1] * np.roll(SEEN, 1)
    assert (rest_of_mean(pv, SEEN) < 1e-9) == mean

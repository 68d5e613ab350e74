"""Tests of the innovations by their own formulas: near 0 for white ones, and as large as is left in
others.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.signal.filters import lfilter
from simbench.gap.decide.left_over import memory_and_input, shifts
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data

N = 4000 + kernels.SKIP
RNG = np.random.default_rng(0)
WHITE, OP = RNG.standard_normal(N), np.cumsum(RNG.standard_normal(N))


def of(residual, u=OP):
    # a likelihood of unit variance
    level = -0.5 * (residual.size - kernels.SKIP) * np.log(2.0 * np.pi)
    squares = float(np.square(residual[kernels.SKIP :]).sum())
    fit = SimpleNamespace(residual=residual, loglik=level - 0.5 * squares)
    return memory_and_input(fit, SimpleNamespace(u=u, size=1.0))


@pytest.mark.parametrize("scale", [0.2, 1.0])
def test_white_innovations_pass_whatever_their_size(scale):
    assert max(abs(x) for x in of(scale * WHITE).values()) < 11.0


@pytest.mark.parametrize("lag", [1, 25, 26])
@pytest.mark.parametrize("share", [0.2, 0.4])
def test_memory_and_input_count_half_a_nat_for_squared_correlations_over_25_lags(lag, share):
    # x_k = w_k + share w_{k-lag} has a correlation of share / (1 + share^2)
    rho = share / (1.0 + share**2)
    expected = 0.5 * 4000 * rho**2 if lag <= 25 else 0.0
    assert of(WHITE + share * np.roll(WHITE, lag))["memory"] == pytest.approx(
        expected, abs=11.0 + 0.2 * expected
    )
    du = np.append(0.0, np.diff(OP))
    expected = 0.5 * 4000 * share**2 / (1.0 + share**2) if lag <= 25 else 0.0
    values = of(WHITE + share * np.roll(du, lag))
    assert values["input"] == pytest.approx(expected, abs=11.0 + 0.2 * expected)
    assert abs(values["memory"]) < 14.0


def a_loop(shift=0.0, jump=0.0, wild=0.0):
    """The fit without an effect of a loop whose PV shifts, or whose load jumps, or with one wild
    sample.
    """
    n, T, rng = 1500, 15.0, np.random.default_rng(7)
    u = 50.0 + np.cumsum(0.2 * rng.standard_normal(n))
    v = u - 50.0 + lfilter([0.3], [1.0, -0.95], rng.standard_normal(n))
    v[700:] += jump
    a = np.exp(-1.0 / T)
    y = lfilter([0.0, 1.0 - a], [1.0, -a], v) + 0.1 * rng.standard_normal(n)
    y[700:] += shift
    y[900] += wild
    engine = Engine(Data(u, y, K=1.0, T=T, Td=0.0, noise=0.1), 60.0)
    return engine, engine.base()


@pytest.mark.parametrize(
    ("shows", "changed"),
    [(False, {}), (True, {"shift": 1.5}), (False, {"jump": 8.0}), (False, {"wild": 1.5})],
)
def test_a_jump_of_pv_is_told_from_a_jump_of_the_load_and_from_a_wild_sample(shows, changed):
    engine, fit = a_loop(**changed)
    [nats] = shifts(engine, [fit])
    assert nats > 20.0 if shows else nats < 0.0

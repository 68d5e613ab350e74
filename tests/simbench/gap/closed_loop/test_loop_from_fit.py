"""From a fitted load back to a loop file: what the simulator makes of it is the load that was fitted."""

import numpy as np
import pytest

from scenarios.spec import Part
from simbench.gap.closed_loop.loop_from_fit import load_parts
from simbench.gap.likelihood import kernels
from simbench.loop.disturbance import disturbance_signal


def simulated(parts, n, rng):
    """Return the load, in PV units, that a loop file with these parts makes."""
    kind = [{"amplitude": std, "period": period, "lag": lag} for std, period, lag in parts]
    return sum(disturbance_signal(Part(name="coloured", parameters=p), n, 1.0, rng)[1] for p in kind)


def fitted(theta, n, rng):
    """Return the load whose model `innovations.whiten` holds: a first-order stage of std `load`, then a second lag."""
    phi = np.exp(-1 / theta["load_time"])
    b = np.exp(-1 / theta["load_lag"])
    first, second, out = 0.0, 0.0, np.empty(n)
    for k, w in enumerate(rng.standard_normal(n) * theta["load"] * np.sqrt(1 - phi**2)):
        out[k] = second
        first, second = phi * first + w, b * second + (1 - b) * first
    return out


@pytest.mark.parametrize("times", [(30.0, 4.0), (10.0, 10.0), (3.0, 20.0)])
def test_a_smooth_load_keeps_its_size_and_memory(times):
    theta = {"load": 2.0, "load_time": times[0], "load_lag": times[1]}
    n, rng = 200_000, np.random.default_rng(1)
    want, got = fitted(theta, n, rng), simulated(load_parts(theta), n, rng)
    ((std, period, lag),) = load_parts(theta)
    assert (period, lag) == times
    assert np.std(want) == pytest.approx(std, rel=0.05)
    assert np.std(got) == pytest.approx(std, rel=0.05)
    for step in (1, 5, 20):
        change = np.std(want[step:] - want[:-step])
        assert np.std(got[step:] - got[:-step]) == pytest.approx(change, rel=0.03)


def test_a_quick_second_stage_is_none():
    assert load_parts({"load": 2.0, "load_time": 30.0, "load_lag": 0.1}) == [(2.0, 30.0, 0.0)]


def test_a_load_of_power_one_over_f_is_three_equal_parts_that_add_to_its_std():
    parts = load_parts({"load": 2.0, "load_time": 50.0})
    assert [(round(period, 9), lag) for _, period, lag in parts] == [(50.0, 0.0), (10.0, 0.0), (2.0, 0.0)]
    assert np.hypot.reduce([std for std, _, _ in parts]) == pytest.approx(2.0)
    signal = simulated(parts, 200_000, np.random.default_rng(2))
    assert np.std(signal) == pytest.approx(2.0, rel=0.03)
    # the filter that whitens such a load in the engine whitens this one
    white = kernels.whiten(signal[None, :], 1e-2, 0.0, 50.0, kernels.PINK, 2.0, 0.0, 0.0, 1e-3, 0.0, 5.0)[0][0, 100:]
    assert np.var(white) == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.01

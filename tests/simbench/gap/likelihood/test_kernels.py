"""The compiled kernels beside slow, obvious twins, and the valve maps beside the loop's own."""

from functools import cache

import numpy as np
import pytest

from simbench.gap.likelihood import kernels
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.plant import sample

RNG = np.random.default_rng(3)
OP = 50 + np.cumsum(RNG.standard_normal(600)) * 0.4


def through(model, parameters, u):
    module = VALVES.load(model)
    p = valve_parameters(module, parameters, 1.0)
    state = module.start(u[0], p)
    out = []
    for x in u:
        state = module.step(x, state, p)
        out.append(state[0])
    return np.array(out)


@pytest.mark.parametrize(("kind", "numbers", "model", "parameters"), [
    (kernels.PLAY, (3.0, 0.0, 0.0), "deadband", {"S": 3.0}),
    (kernels.ZONE, (3.0, 51.0, 0.0), "deadzone", {"D": 3.0, "c": 51.0}),
    (kernels.STICK, (3.0, 1.2, 0.0), "choudhury", {"S": 3.0, "J": 1.2}),
    (kernels.CREEP, (3.0, 1.2, 0.0), "he", {"fs": 2.1, "fd": 0.9}),
    (kernels.CURVE, (5.0, 0.0, 0.0), "gain_ratio", {"R": 5.0}),
])  # fmt: skip
def test_a_valve_map_is_the_simulators(kind, numbers, model, parameters):
    assert np.allclose(kernels.valve(OP, kind, *numbers), through(model, parameters, OP), atol=1e-9)


def test_a_pole_of_no_length_is_none():
    assert np.array_equal(kernels.plant(OP, 12.0, 3.4, 1e-3), kernels.plant(OP, 12.0, 3.4, 0.0))
    assert not np.array_equal(kernels.plant(OP, 12.0, 3.4, 2e-3), kernels.plant(OP, 12.0, 3.4, 0.0))


@pytest.mark.parametrize(("T", "lag"), [(12.0, 0.0), (12.0, 5.0), (0.0, 0.0), (0.0, 5.0)])
def test_the_plant_answers_as_the_simulators(T, lag):
    den = np.array([1.0, 0.0]) if T == 0 else np.array([T, 1.0])
    if lag:
        den = np.polymul(den, [lag, 1.0])
    p = sample(np.array([1.0]), den, 3.4, 1.0)
    w = OP - OP[0]
    x, out = np.zeros(p.order), []
    for k in range(OP.size):
        out.append(p.C @ x)
        new = w[k - p.delay] if k >= p.delay else 0.0
        old = w[k - p.delay - 1] if k > p.delay else 0.0
        x = p.A @ x + p.B_old * old + p.B_new * new
    assert np.allclose(kernels.plant(OP, T, 3.4, lag), out, atol=1e-7)


def through_pole(covariance, pole, gain, start):
    """Return the covariance behind x_k+1 = pole x_k + gain u_k, begun with a standard deviation of
    `start`.
    """
    k = np.arange(len(covariance))
    A = np.where(k[:, None] > k, gain * pole ** np.clip(k[:, None] - 1 - k, 0, None), 0.0)
    return A @ covariance @ A.T + start**2 * np.outer(pole**k, pole**k)


NOISE, SPREAD = 0.4, 5.0


def covariance(n, T, loads, *, lag=0.0, tau=0.0, load_walk=0.0, walk=0.0, colour=0.0):
    """Return the covariance of PV: loads (time constant, std) through a second lag, the plant and
    one more pole, and noise.
    """
    k = np.arange(n)
    apart, walked = np.abs(k[:, None] - k), np.minimum(k[:, None], k).astype(float)
    load = sum(std**2 * np.exp(-apart / time) for time, std in loads)
    if lag:
        load = through_pole(
            load, np.exp(-1 / lag), 1 - np.exp(-1 / lag), np.sqrt(sum(std**2 for _, std in loads))
        )
    load = load + load_walk**2 * walked
    a = np.exp(-1 / T) if T else 1.0
    pv = through_pole(load, a, 1 - a if T else 1.0, SPREAD)
    if tau:
        pv = through_pole(pv, np.exp(-1 / tau), 1 - np.exp(-1 / tau), SPREAD)
    return pv + walk**2 * walked + NOISE**2 * (colour**apart if colour else np.eye(n))


LOAD = [(15.0, 1.3)]


@pytest.mark.parametrize(
    ("T", "loads", "more"),
    [
        (8.0, LOAD, {}),
        (0.0, LOAD, {}),
        (8.0, LOAD, {"lag": 4.0}),
        (8.0, LOAD, {"colour": -0.4}),
        (8.0, [(15.0 / 5**i, 1.3 / np.sqrt(3)) for i in range(3)], {}),
        (8.0, LOAD, {"lag": 4.0, "tau": 3.0, "load_walk": 0.2, "walk": 0.15, "colour": 0.4}),
        (0.0, [(15.0 / 5**i, 1.3 / np.sqrt(3)) for i in range(3)], {"tau": 3.0, "walk": 0.15}),
    ],
    ids=lambda x: "+".join(x) if isinstance(x, dict) else None,
)
def test_whitening_is_cholesky_of_the_covariance(T, loads, more):
    y = np.random.default_rng(4).standard_normal(150)
    L = np.linalg.cholesky(covariance(150, T, loads, **more))
    lag = kernels.PINK_LOAD if len(loads) == 3 else more.get("lag", 0.0)
    rest = {name: x for name, x in more.items() if name != "lag"}
    model = kernels.NoiseModel(T, 0.0, 15.0, lag, 1.3, NOISE, 0.0, SPREAD)._replace(**rest)
    white, logs = kernels.whiten(y[None, :], model, kernels.NO_JUMPS)
    # the kernel's gain stands still once it has settled
    assert white[0] == pytest.approx(np.linalg.solve(L, y), abs=2e-4)
    assert logs == pytest.approx(2 * np.sum(np.log(np.diag(L))[kernels.SKIP :]), abs=2e-3)


@cache
def without_jumps(n, T):
    return covariance(n, T, LOAD)


@pytest.mark.parametrize("T", [8.0, 0.0])
@pytest.mark.parametrize("places", [(100,), (100, 103, 140), (12, 500), (100, 450)])
def test_jumps_of_the_load_widen_the_covariance_from_where_they_are(T, places):
    n, load_time, jump = 700, 15.0, 6.0
    y = np.random.default_rng(4).standard_normal(n)
    whole = without_jumps(n, T)
    a = np.exp(-1 / T) if T else 1.0
    for k in [*places, *(k + 1 for k in places)]:
        height = np.zeros(n)
        height[k:] = 1.0
        moved = np.zeros(n)
        for t in range(n - 1):
            moved[t + 1] = a * moved[t] + (1 - a if T else 1.0) * height[t]
        whole = whole + jump**2 * np.outer(moved, moved)
    L = np.linalg.cholesky(whole)
    model = kernels.NoiseModel(T, 0.0, load_time, 0.0, 1.3, NOISE, 0.0, SPREAD)
    jumps = kernels.Jumps(np.array(places), jump)
    white, logs = kernels.whiten(y[None, :], model, jumps)
    # long after a jump the kernel's gain stands still, and a later one is followed as if it
    # were the first
    assert white[0] == pytest.approx(np.linalg.solve(L, y), abs=0.05)
    assert logs == pytest.approx(2 * np.sum(np.log(np.diag(L))[kernels.SKIP :]), abs=0.5)

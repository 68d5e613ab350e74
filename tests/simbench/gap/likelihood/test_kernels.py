"""The compiled kernels beside slow, obvious twins, and the valve maps beside the loop's own."""

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


def naive_whiten(y, T, loads, noise, spread):
    """The textbook Kalman filter, states (plant, loads by time constant and std), full matrices, no frozen gain."""
    a, phi = np.exp(-1 / T), np.exp(-1 / np.array([time for time, _ in loads]))
    variance = np.array([std**2 for _, std in loads])
    F = np.diag([a, *phi])
    F[0, 1:] = 1 - a
    Q = np.diag([0.0, *variance * (1 - phi**2)])
    P, x, h = np.diag([spread**2, *variance]), np.zeros(len(F)), np.eye(len(F))[0]
    out, logs = [], 0.0
    for k, value in enumerate(y):
        S = h @ P @ h + noise**2
        gain = F @ P @ h / S
        nu = value - h @ x
        x = F @ x + gain * nu
        P = F @ P @ F.T + Q - np.outer(gain, gain) * S
        out.append(nu / np.sqrt(S))
        logs += np.log(S) if k >= kernels.SKIP else 0.0
    return np.array(out), logs


@pytest.mark.parametrize(("lag", "loads"), [
    (0.0, [(15.0, 1.3)]),
    (kernels.PINK, [(15.0, 1.3 / np.sqrt(3)), (3.0, 1.3 / np.sqrt(3)), (0.6, 1.3 / np.sqrt(3))]),
])  # fmt: skip
def test_whitening_is_the_textbook_filter(lag, loads):
    y = RNG.standard_normal(400)
    white, logs = kernels.whiten(y[None, :], 8.0, 0.0, 15.0, lag, 1.3, 0.0, 0.0, 0.4, 0.0, 5.0)
    slow, slow_logs = naive_whiten(y, 8.0, loads, 0.4, 5.0)
    assert np.allclose(white[0], slow, atol=1e-5)
    assert logs == pytest.approx(slow_logs, abs=1e-3)


def test_innovations_of_the_right_model_are_white_and_of_variance_one():
    n, T, load_time, load, noise = 20000, 8.0, 15.0, 1.0, 0.3
    rng = np.random.default_rng(0)
    phi, a = np.exp(-1 / load_time), np.exp(-1 / T)
    d, x, y = 0.0, 0.0, np.empty(n)
    for k in range(n):
        y[k] = x + noise * rng.standard_normal()
        x = a * x + (1 - a) * d
        d = phi * d + load * np.sqrt(1 - phi**2) * rng.standard_normal()
    white = kernels.whiten(y[None, :], T, 0.0, load_time, 0.0, load, 0.0, 0.0, noise, 0.0, 5.0)[0][0, 10:]
    assert np.var(white) == pytest.approx(1.0, abs=0.04)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.03


def test_every_channel_is_filtered_alike():
    y = RNG.standard_normal((2, 200))
    both = kernels.whiten(np.vstack([y, y[0] + 2 * y[1]]), 8.0, 0.0, 15.0, 3.0, 1.3, 0.2, 0.1, 0.4, 0.3, 5.0)[0]
    assert np.allclose(both[2], both[0] + 2 * both[1])

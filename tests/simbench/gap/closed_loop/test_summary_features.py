"""Features of signals whose values are known: white noise, sines, a level."""

import numpy as np
import pytest

from simbench.gap.closed_loop.gap import (
    features,
)

N = 1024
T = np.arange(N)
W = np.random.default_rng(0).standard_normal(20_000)
# 2 (513/2)^(i/6): each band is some two and a half times as wide as the one before
EDGES = [2, 5, 12, 32, 80, 203, 513]


def of(pv=None, op=None):
    """Return the features of PV around a set point of 0, and of OP; what is not given is 0."""
    nothing = np.zeros(N if pv is op is None else (pv if op is None else op).shape)
    return features(nothing if op is None else op, nothing if pv is None else pv, nothing)


def sine(periods, amplitude=1.0):
    return amplitude * np.sin(2 * np.pi * periods * T / N + 0.3)


def test_white_noise_has_the_features_of_white_noise():
    n = 4000
    f = of(3.0 * W[:n], W[n : 2 * n])
    expected = {
        "pv size": np.log(3.0),
        "pv change": np.log(3.0 * np.sqrt(2.0)),
        "pv kurtosis": np.log(4.0),
        "pv change kurtosis": np.log(4.0),
        "pv at rest": np.log(0.01),
        "pv straight": np.log(0.01),
        "pv wander": 0.0,
        "pv at limit": np.log(0.01 + 2 / n),
        **{f"pv memory {lag}": 0.0 for lag in (1, 3, 10, 30)},
        **{f"op after pv {lag}": 0.0 for lag in (0, 1, 3)},
        **{f"pv after op {lag}": 0.0 for lag in (2, 6)},
    }
    assert {k: f[k] for k in expected} == pytest.approx(expected, abs=0.15)
    # white noise has as much power in each bin
    bands = np.array([np.exp(f[f"pv band {i}"]) for i in range(1, 7)])
    edges = np.geomspace(2, n // 2 + 1, 7).astype(int)
    assert bands[2:] == pytest.approx(9.0 * 0.375 * np.diff(edges)[2:], rel=0.3)


@pytest.mark.parametrize("amplitude", [0.01, 3.0])
def test_a_sine_has_the_size_change_and_memory_of_one(amplitude):
    values = of(op=sine(64, amplitude))
    w = 2 * np.pi / 16
    assert values["op size"] == pytest.approx(np.log(amplitude / np.sqrt(2)), abs=1e-6)
    assert values["op change"] == pytest.approx(
        np.log(2 * np.sin(w / 2) * amplitude / np.sqrt(2)), abs=1e-3
    )
    # the fourth power of a sine is 3/8, its square 1/2
    assert values["op kurtosis"] == pytest.approx(np.log(2.5), abs=1e-6)
    assert values["op change kurtosis"] == pytest.approx(np.log(2.5), abs=1e-3)
    for lag in (1, 3, 10, 30):
        assert values[f"op memory {lag}"] == pytest.approx(np.cos(w * lag), abs=4e-3)


def test_the_level_does_not_show_and_pv_is_seen_from_the_set_point():
    pv, op, sp = W[:N], W[N : 2 * N], np.linspace(20.0, 70.0, N)
    one, other = of(pv, op), features(50.0 + op, sp + pv, sp)
    assert list(one) == list(other)
    assert list(one.values()) == pytest.approx(list(other.values()), abs=1e-6)


@pytest.mark.parametrize("band", range(1, 7))
def test_the_power_of_a_sine_lies_in_its_band(band):
    # behind a Hann window a sine is its own line and two of a quarter; at a band's lower edge one
    # of these falls below
    values = of(sine(EDGES[band - 1]))
    power = {i: np.exp(values[f"pv band {i}"]) for i in range(1, 7)}
    assert power[band] == pytest.approx(N / 16 * 1.25, rel=0.02)
    assert power.get(band - 1, power[band] / 5) == pytest.approx(power[band] / 5, rel=0.03)
    assert sum(power.values()) == pytest.approx(N / 16 * (1.5 if band > 1 else 1.25), rel=0.02)

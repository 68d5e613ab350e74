"""Every feature by signals whose value is known: sines, staircases, noise that follows noise, and
nothing at all.
"""

import numpy as np
import pytest

from simbench.gap.closed_loop.summary_features import (
    chance_of,
    distance,
    features,
    floor_of,
    least_spread,
    seed_spread,
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


def test_sharpness_is_the_share_of_the_three_strongest_lines():
    # each of five sines has a line of 1 and two of 1/4
    values = of(sum(sine(k) for k in (3, 50, 100, 150, 200)))
    assert values["pv sharpness"] == pytest.approx(np.log(0.001 + 3.0 / 7.5), abs=0.02)
    # what lies below two periods is trend
    assert of(sine(300) + sine(1, 9.0) - sine(1, 9.0).mean())["pv sharpness"] > np.log(0.5)


@pytest.mark.parametrize(
    ("step", "rests", "straight"),
    [(0.0, 1.0, 1.0), (0.5e-9, 1.0, 1.0), (2e-9, 0.5, 1.0), (2e-6, 0.5, 0.5)],
)
def test_rest_and_straight_lines_are_counted_relative_to_the_size(step, rests, straight):
    # half of the record wanders up and down by a step; the other half stands, and a jump between
    # gives a size of 1
    creep = np.zeros(1000)
    creep[:500] = step * (np.arange(500) % 2)
    values = of(np.concatenate([creep[:500], creep[500:] + 2.0]))
    assert values["pv at rest"] == pytest.approx(np.log(0.01 + rests), abs=0.01)
    assert values["pv straight"] == pytest.approx(np.log(0.01 + straight), abs=0.01)


def test_of_nothing_every_feature_is_finite_and_neutral():
    values = of()
    for name in ("pv", "op"):
        assert values[f"{name} size"] == values[f"{name} change"] == pytest.approx(np.log(1e-9))
        assert values[f"{name} band 3"] == pytest.approx(np.log(1e-12))
        assert values[f"{name} sharpness"] == pytest.approx(np.log(1e-3))
        for known in ("kurtosis", "change kurtosis", "memory 10", "wander"):
            assert values[f"{name} {known}"] == 0.0
    assert values["op after pv 0"] == values["pv after op 2"] == 0.0


LEADS = {
    "op after pv 0": 0,
    "op after pv 1": 1,
    "op after pv 3": 3,
    "pv after op 2": -2,
    "pv after op 6": -6,
}


@pytest.mark.parametrize("lag", LEADS.values())
def test_what_follows_what_and_when(lag):
    values = of(np.cumsum(W), np.cumsum(np.roll(W, lag)))
    for name, at in LEADS.items():
        assert values[name] == pytest.approx(1.0 if at == lag else 0.0, abs=0.03), name


def test_several_runs_at_once_are_each_by_itself():
    pv, op = W[:3000].reshape(3, 1000), W[3000:6000].reshape(3, 1000)
    together = np.array(list(of(pv, op).values())).T
    assert together == pytest.approx(np.array([list(of(p, o).values()) for p, o in zip(pv, op)]))


SIMS = np.array([[0.0, 0.0], [1.0, 4.0], [2.0, 8.0]])


def test_distances_are_in_spreads_and_capped_at_twelve():
    least = np.array([0.03, 2.0])
    assert seed_spread(SIMS, least).tolist() == [1.0, 4.0]
    assert seed_spread(np.zeros((3, 2)), least).tolist() == [0.03, 2.0]


def test_a_share_of_counted_samples_is_known_to_one_of_them():
    one, two, many = (np.log(0.01 + k / 200) for k in (1, 2, 100))
    least = least_spread({"pv at limit": one, "op size": 0.0, "op at rest": many}, 200)
    # from the first sample to the second in 200
    assert least[0] == pytest.approx(two - one, rel=0.2)
    # what is known better than that counts as all others do
    assert list(least[1:]) == [0.03, 0.03]
    assert distance(np.array([3.0, 4.0]), SIMS, np.array([1.0, 4.0])) == pytest.approx(1.0)
    assert distance(np.array([1000.0, 4.0]), SIMS, np.array([1.0, 4.0])) == pytest.approx(6.0)


def test_the_floor_is_how_far_each_seed_lies_from_the_others():
    # the outer two lie 1.5 spreads from the mean of their others, the middle one on it
    assert floor_of(SIMS, np.array([1.0, 4.0])) == pytest.approx(1.0)
    assert chance_of(SIMS, np.array([1.0, 4.0])) == pytest.approx([0.5, -1.0, 0.5])
    assert floor_of(100.0 * SIMS, np.array([1.0, 4.0])) == pytest.approx(8.0)

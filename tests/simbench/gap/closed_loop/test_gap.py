"""The gap's ruler: features with known values, distances, and the share that closes."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop.gap import closed, held_out, measure
from simbench.gap.closed_loop.summary_features import chance_of, distance, features, floor_of, seed_spread

N = 4000
WHITE = np.random.default_rng(0).standard_normal((2, N))
T = np.arange(N)


def of(pv, op=WHITE[1], sp=0.0):
    return features(op, pv, np.full(pv.shape, sp))


def test_white_noise_has_the_features_of_white_noise():
    f = of(3.0 * WHITE[0] + 40.0, sp=40.0)
    expected = {
        "pv size": np.log(3.0), "pv change": np.log(3.0 * np.sqrt(2.0)), "pv kurtosis": np.log(4.0),
        "pv change kurtosis": np.log(4.0), "pv at rest": np.log(0.01), "pv straight": np.log(0.01), "pv wander": 0.0,
        "pv at limit": np.log(0.01 + 2 / N), **{f"pv memory {lag}": 0.0 for lag in (1, 3, 10, 30)},
        **{f"op after pv {lag}": 0.0 for lag in (0, 1, 3)}, **{f"pv after op {lag}": 0.0 for lag in (2, 6)},
    }  # fmt: skip
    assert {k: f[k] for k in expected} == pytest.approx(expected, abs=0.15)
    # white noise has as much power in each bin
    bands = np.array([np.exp(f[f"pv band {i}"]) for i in range(1, 7)])
    edges = np.geomspace(2, N // 2 + 1, 7).astype(int)
    assert bands[2:] == pytest.approx(9.0 * 0.375 * np.diff(edges)[2:], rel=0.3)


def test_a_sine_is_sharp_remembers_and_a_ramp_wanders():
    f = of(np.sin(2 * np.pi * T / 40.0))
    assert f["pv memory 10"] == pytest.approx(0.0, abs=0.01)
    assert f["pv memory 30"] == pytest.approx(0.0, abs=0.01)
    assert f["pv memory 1"] == pytest.approx(np.cos(np.pi / 20.0), abs=0.01)
    assert f["pv memory 3"] == pytest.approx(np.cos(3 * np.pi / 20.0), abs=0.01)
    assert f["pv kurtosis"] == pytest.approx(np.log(2.5), abs=0.01)
    assert f["pv sharpness"] == pytest.approx(0.0, abs=0.01)
    # five equal parts of a ramp: means -2 .. 2 of 5 widths, of a standard deviation of 5 / sqrt(12) widths
    assert of(T / N)["pv wander"] == pytest.approx(np.sqrt(2.0) / (5.0 / np.sqrt(12.0)), rel=1e-3)


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_rest_straightness_and_limits_are_shares_of_the_samples(share):
    still = WHITE[0].copy()
    still[: int(share * N)] = 0.3
    assert of(still)["pv at rest"] == pytest.approx(np.log(0.01 + share), abs=0.01)
    assert of(still)["pv straight"] == pytest.approx(np.log(0.01 + share), abs=0.01)
    line = WHITE[0].copy()
    line[: int(share * N)] = np.linspace(-1.0, 1.0, int(share * N))
    assert of(line)["pv straight"] == pytest.approx(np.log(0.01 + share), abs=0.01)
    assert of(line)["pv at rest"] == pytest.approx(np.log(0.01), abs=0.01)
    cut = np.minimum(WHITE[0], np.quantile(WHITE[0], 1.0 - share))
    assert of(cut)["pv at limit"] == pytest.approx(np.log(0.01 + share), abs=0.01)


@pytest.mark.parametrize(("first", "second", "lag", "name"), [
    (0, 1, 0, "op after pv 0"), (0, 1, 1, "op after pv 1"), (0, 1, 3, "op after pv 3"), (1, 0, 2, "pv after op 2"),
    (1, 0, 6, "pv after op 6"),
])  # fmt: skip
def test_who_follows_whom_shows_at_its_lag(first, second, lag, name):
    signals = {first: WHITE[0], second: np.roll(WHITE[0], lag)}
    f = of(signals[0], signals[1])
    assert f[name] == pytest.approx(1.0, abs=0.02)


def test_distances_count_seed_to_seed_deviations_up_to_twelve():
    sims, spread = np.array([[1.0, 5.0], [3.0, 5.0]]), np.array([0.5, 2.0])
    assert distance(np.array([2.0, 5.0]), sims, spread) == 0.0
    assert distance(np.array([3.0, 9.0]), sims, spread) == pytest.approx(2.0)
    assert distance(np.array([7.5, 5.0]), sims, spread) == pytest.approx(11.0 / 2)
    assert distance(np.array([99.0, 5.0]), sims, spread) == pytest.approx(12.0 / 2)
    assert seed_spread(sims) == pytest.approx([np.sqrt(2.0), 0.03])
    # each of the two lies two from the other, four of the first spread
    assert floor_of(sims, spread) == pytest.approx(2.0)
    odd = np.array([[0.0], [0.0], [3.0]])
    assert chance_of(odd, np.array([1.0])) == pytest.approx([-0.5, -0.5, 1.0])


@pytest.mark.parametrize(("before", "after", "share"), [
    (3.0, 2.0, 0.5), (3.0, 1.0, 1.0), (3.0, 0.2, 1.0), (3.0, 3.0, 0.0), (3.0, 4.0, -0.5), (3.0, 99.0, -1.0), (5.0, 2.0, 0.75),
])  # fmt: skip
def test_the_share_that_closes_is_of_what_lies_above_the_floor(before, after, share):
    assert closed(before, after, 1.0) == pytest.approx(share)


@pytest.mark.parametrize(("off", "resolvable"), [(0.0, False), (0.9, False), (2.0, True), (6.0, True)])
def test_a_gap_is_resolvable_from_one_and_a_half_floors(off, resolvable):
    s = SimpleNamespace(record=SimpleNamespace(pv=WHITE[0], n=N), op=WHITE[1], sp=np.zeros(N))
    assert held_out(s) == 2600
    real = np.array(list(features(WHITE[1][2600:], WHITE[0][2600:], np.zeros(1400)).values()))
    rng = np.random.default_rng(1)
    runs = [SimpleNamespace(features=real + o + rng.standard_normal((8, real.size))) for o in (off, off / 2, 0.0)]
    found = measure(s, *runs)
    assert found.resolvable == resolvable
    # eight seeds: each lies sqrt(8/7) from the mean of the others, at sqrt(2/pi) on average
    assert found.floor == pytest.approx(np.sqrt(8 / 7 * 2 / np.pi), abs=0.1)
    assert found.after < 0.5
    if resolvable:
        assert found.before == pytest.approx(off, rel=0.1)
        assert found.recalibrated == pytest.approx(off / 2, rel=0.15)
        assert found.value == 1.0
        assert 0.6 < found.lo <= found.hi == 1.0
    else:
        assert (found.value, found.lo, found.hi) == (None, 0.0, 0.0)
    assert np.mean([b for b, _ in found.per_feature.values()]) == pytest.approx(found.before, rel=0.02)
    assert np.mean([a for _, a in found.per_feature.values()]) == pytest.approx(found.after, rel=0.02)

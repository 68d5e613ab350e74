"""The common front end: what oscillates, how regularly, how long, and where."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.detectors.signal import autocorrelation as a
from simbench.detectors.signal import oscillation as o

T = np.arange(2000.0)
RNG = np.random.default_rng(11)


def naive_acf(x):
    return np.array(
        [sum(x[k] * x[k + lag] for k in range(x.size - lag)) for lag in range(x.size // 2)]
    ) / (x @ x)


def naive_crossings(x, band):
    """One sample at a time: a crossing counts once the signal has left the band on the other
    side.
    """
    crossings, changes, side = [], [], 0
    for k in range(x.size):
        if k and (x[k] > 0) != (x[k - 1] > 0):
            changes.append(k - 1)
        if abs(x[k]) > band:
            now = 1 if x[k] > 0 else -1
            if side and now != side:
                i = changes[(len(changes) - 1) // 2]
                crossings.append(i + x[i] / (x[i] - x[i + 1]))
            if now != side or abs(x[k]) > band:
                changes = []
            side = now
    return np.array(crossings)


def test_acf_equals_the_sums_it_stands_for():
    x = a.detrend(RNG.standard_normal(301))
    assert np.allclose(a.acf(x), naive_acf(x), atol=1e-12)


@pytest.mark.parametrize("band", [0.0, 0.3, 1.0])
def test_crossings_equal_those_counted_sample_by_sample(band):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = np.sin(np.arange(200) / 7) + 0.5 * rng.standard_normal(200)
        assert np.allclose(a.zero_crossings(x, band), naive_crossings(x, band))


@pytest.mark.parametrize("period", [10.0, 42.3, 150.0])
def test_sine_is_sustained_with_its_period(period):
    oscillation = o.oscillation_of(np.sin(2 * np.pi * T / period + 0.4), 2.0)
    assert oscillation.sustained
    assert oscillation.period_s == pytest.approx(2.0 * period, rel=0.005)
    assert oscillation.regularity > 10.0
    assert oscillation.decay_ratio == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("n", [126, 500, 4000])
@pytest.mark.parametrize("pole", [0.0, 0.9, 1.0])
def test_noise_of_any_colour_is_not_sustained(n, pole):
    from scipy.signal import lfilter

    rng = np.random.default_rng(n)
    sustained = [
        o.oscillation_of(lfilter([1.0], [1.0, -pole], rng.standard_normal(n))).sustained
        for _ in range(100)
    ]
    assert np.mean(sustained) <= 0.05


def test_constant_short_and_rounding_noise_are_nothing():
    for x in (
        np.full(500, 7.0),
        np.full(500, 0.1) + 1e-17,
        np.arange(500.0),
        np.array([1.0, 2.0, 1.0]),
    ):
        assert o.oscillation_of(x) == o.NOTHING


@pytest.mark.parametrize("tau", [100.0, 300.0, 600.0])
def test_transient_that_dies_out_is_not_sustained(tau):
    assert not o.oscillation_of(np.exp(-T / tau) * np.sin(T / 6)).sustained


def test_oscillation_that_starts_late_is_sustained():
    assert o.oscillation_of(np.where(T > 700, np.sin(T / 6), 0.0)).sustained


@pytest.mark.parametrize("disturbance", ["ramp", "parabola", "steps", "walk"])
def test_drift_larger_than_the_oscillation_does_not_hide_it(disturbance):
    drift = {
        "ramp": T / 100,
        "parabola": (T - 700) ** 2 / 1e5,
        "steps": 4.0 * (T > 500) - 6.0 * (T > 1300),
        "walk": np.cumsum(np.random.default_rng(5).standard_normal(2000)) * 0.2,
    }[disturbance]
    oscillation = o.oscillation_of(np.sin(2 * np.pi * T / 40) + drift)
    assert oscillation.sustained
    assert oscillation.period_s == pytest.approx(40.0, rel=0.05)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(1e-3, 1e3),
    st.sampled_from([1.0, -1.0]),
    st.floats(-1e3, 1e3),
    st.floats(1e-3, 1e3),
    st.floats(-1e3, 1e3),
)
def test_finding_does_not_depend_on_units(scale, sign, b, c, d):
    rng = np.random.default_rng(2)
    op, pv = np.sin(T[:800] / 7) + 0.4 * rng.standard_normal((2, 800))
    one, other = (
        o.find_oscillation(op, pv, 1.0),
        o.find_oscillation(c * op + d, sign * scale * pv + b, 1.0),
    )
    assert (one.sustained, one.signal) == (other.sustained, other.signal)
    assert other.period_s == pytest.approx(one.period_s, rel=1e-6)


def test_decay_ratio_is_the_decay_per_half_period():
    k = np.arange(400)
    for d in (0.3, 0.6, 0.9):
        rho = d ** (k / 50) * np.cos(np.pi * k / 50)
        assert a.decay_ratio(rho, a.zero_crossings(rho)) == pytest.approx(d, abs=0.04)


def test_segment_is_where_the_oscillation_is_regular():
    rng = np.random.default_rng(4)
    x = np.sin(2 * np.pi * T / 40) + np.where(
        (T > 800) & (T < 1400), 0.05, 1.0
    ) * rng.standard_normal(2000)
    start, stop = o.regular_segment(x, 40.0, 400)
    assert stop - start == 400
    assert start >= 780
    assert stop <= 1420
    assert o.regular_segment(x, 40.0, 5000) == (0, 2000)


def test_segment_equals_the_slow_search():
    x = a.detrend(np.sin(T[:300] / 5) + np.random.default_rng(1).standard_normal(300))
    lag, length = round(10 * np.pi), 120

    def likeness(k):
        late, early = x[k + lag : k + length], x[k : k + length - lag]
        return (late @ early) / np.sqrt((late @ late) * (early @ early))

    best = max(range(300 - length + 1), key=likeness)
    assert o.regular_segment(x, 10 * np.pi, length)[0] == best

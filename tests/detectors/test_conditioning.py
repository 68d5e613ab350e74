"""Drift, noise and direction of a signal, against their slow twins."""

import numpy as np
import pytest

from simbench.detectors.signal import conditioning as c

T = np.arange(1000.0)
RNG = np.random.default_rng(8)


def naive_drift(x, period, k):
    fine = np.linspace(k - period / 2, k + period / 2, 20001)
    return np.trapezoid(np.interp(fine, np.arange(x.size), x), fine) / period


@pytest.mark.parametrize("period", [7.0, 20.0, 33.3, 120.5])
def test_drift_is_the_mean_over_one_period(period):
    x = RNG.standard_normal(400)
    drift = c.drift(x, period)
    for k in range(int(period / 2) + 1, 398 - int(period / 2), 17):
        assert drift[k] == pytest.approx(naive_drift(x, period, k), abs=2e-4)


def test_drift_keeps_a_straight_line_up_to_both_ends_and_holds_no_oscillation():
    x = 0.03 * T + np.sin(2 * np.pi * T / 50)
    assert np.abs(c.drift(x, 50.0) - 0.03 * T).max() < 0.01


@pytest.mark.parametrize("n", [3, 10, 51])
def test_drift_copes_with_records_shorter_than_the_period(n):
    assert np.isfinite(c.drift(RNG.standard_normal(n), 60.0)).all()


def test_band_does_not_shift_the_oscillation_in_time():
    x = np.sin(2 * np.pi * T / 50 + 1.0)
    clean = c.band(x + 0.01 * T + 0.2 * RNG.standard_normal(1000), 50.0, 3.0)
    lags = [clean[100 + k : 900 + k] @ x[100:900] for k in range(-5, 6)]
    assert np.argmax(lags) == 5


def test_direction_of_pv_is_that_of_the_process_in_a_noisy_sticky_loop(loop):
    for seed in range(5):
        record = loop(noise=0.3, seed=seed, T=3.0, Td=2.0, Kc=0.4, Ti=4.0)
        assert c.loop_sign(record.op, record.pv, 5) == 1.0
        assert c.loop_sign(record.op, -record.pv, 5) == -1.0


@pytest.mark.parametrize("n", [1, 2, 7, 100])
def test_median_is_that_of_numpy(n):
    x = RNG.standard_normal(n)
    assert c.median(x) == np.median(x)


def test_what_rounding_made_unlike_is_alike_again():
    assert 0.1 + 0.2 != 0.3
    assert c.snapped(np.array([0.1 + 0.2])) == c.snapped(np.array([0.3]))

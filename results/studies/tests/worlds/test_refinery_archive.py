"""The refinery's historian and baseline fit: each against its definition."""

from __future__ import annotations

import numpy as np

from results.studies.worlds.refinery import archive, baseline


def series(n=2000, seed=0):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.standard_normal(n)) * 0.3 + rng.standard_normal(n)


def test_swinging_door_errs_by_at_most_its_band_and_by_hand():
    x = series()
    for band in (0.05, 2.0):
        assert np.abs(archive.swinging_door(x, band) - x).max() <= band * (1 + 1e-9)
    assert np.mean(np.abs(np.diff(archive.swinging_door(x, 2.0), 2)) > 1e-9) < 0.4
    # from 0 the door of .5 lets 0, 1, 2 pass on one line; 5 does not, so that 2 is archived
    np.testing.assert_allclose(
        archive.swinging_door(np.array([0.0, 1.3, 2.0, 5.0]), 0.5), [0.0, 1.0, 2.0, 5.0]
    )


def test_exception_reports_keep_jumps_sudden_and_small_moves_out():
    x = np.array([0.0, 0.1, 0.0, 0.05, 5.0, 5.0, 5.1, 5.0])
    np.testing.assert_allclose(
        archive.exceptions(x, 0.2), [0.0, 0.05 / 3, 0.1 / 3, 0.05, 5.0, 5.05, 5.1, 5.0]
    )


def test_baseline_of_a_plant_with_small_lags_is_the_closest_first_order_response():
    plant = {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 3.0, "lag1": 1.5, "lag2": 0.7}
    base = baseline.fitted(plant)
    t = np.linspace(0, 50, 400)
    goal = baseline.step_response(t, 10.0, (1.5, 0.7))

    def error(T, Td):
        return np.sum((baseline.step_response(t - Td, T, (0.0, 0.0)) - goal) ** 2)

    best = error(base["T"], base["Td"] - 3.0)
    assert best < 0.1 * error(10.0, 0.0)
    for dT, dTd in ((0.3, 0), (-0.3, 0), (0, 0.3), (0, -0.3)):
        assert best < error(base["T"] + dT, base["Td"] - 3.0 + dTd)

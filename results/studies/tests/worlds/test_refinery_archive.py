"""The refinery's historian, loads, noise, set points and baseline fit: each against its
definition.
"""

from __future__ import annotations

import numpy as np
import pytest

from results.studies.worlds.refinery import archive, baseline, loads
from results.studies.worlds.refinery.setpoint import pattern


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


@pytest.mark.parametrize("kind", loads.NOISES)
def test_noise_has_variance_one(kind):
    x = loads.noise(np.random.default_rng(3), 100_000, {"kind": kind, "phi": 0.6})
    assert x.std() == pytest.approx(1.0, rel=0.03)
    assert np.corrcoef(x[1:], x[:-1])[0, 1] == pytest.approx(
        0.6 if kind == "ar1" else 0.0, abs=0.02
    )
    assert np.abs(x).max() < 5.5


@pytest.mark.parametrize(
    ("draw", "settings"),
    [
        (loads.ornstein_uhlenbeck, (5.0,)),
        (loads.pink, (0.3,)),
        (loads.jumps, (0.1,)),
        (loads.telegraph, (0.1,)),
        (loads.shot, (0.2, 5.0)),
    ],
)
def test_unit_loads_have_mean_zero_and_variance_one(draw, settings):
    x = draw(np.random.default_rng(1), 200_000, 0.1, *settings)
    assert abs(x.mean()) < 0.2
    assert x.std() == pytest.approx(1.0, rel=0.15)
    if draw is loads.jumps:
        assert np.mean(np.diff(x) != 0.0) == pytest.approx(0.01, rel=0.1)


def test_set_point_patterns():
    knots = [[3, 2.0], [6, 4.0]]
    assert pattern({"kind": "constant", "value": 1.0}, 2, 3, 1.0).tolist() == [1.0] * 5
    steps = pattern({"kind": "steps", "value": 1.0, "knots": knots}, 0, 8, 1.0)
    assert steps.tolist() == [1.0] * 3 + [2.0] * 3 + [4.0] * 2
    ramp = pattern({"kind": "ramps", "value": 1.0, "knots": knots}, 0, 8, 1.0)
    np.testing.assert_allclose(ramp[3:7], [2, 2 + 2 / 3, 2 + 4 / 3, 4])
    wander = {"kind": "cascade", "value": 9.0, "size": 2.0, "time": 30.0, "seed": 5}
    x = pattern(wander, 0, 50_000, 1.0)
    assert x.std() == pytest.approx(2.0, rel=0.25)
    assert np.array_equal(x, pattern(wander, 0, 50_000, 1.0))


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

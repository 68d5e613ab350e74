"""What tests add: lab samples tell a drifting measurement, a valve found by MV is known everywhere, another plant is found."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.spec import Part
from simbench.gap.decide.beside_tests import joint_engine, lab_gains
from simbench.gap.effects import recogniser
from simbench.gap.likelihood.model import Data

by_lab = recogniser("drift").by_lab
TIME = np.linspace(0.0, 1000.0, 40)


def test_a_walk_is_likelier_under_its_own_size_and_noise_under_none():
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.standard_normal(40)) * np.sqrt(TIME[1]) * 0.1
    assert by_lab({"rate": 0.0, "walk": 0.1}, walk, TIME, 0.1) > by_lab({"rate": 0.0, "walk": 0.0}, walk, TIME, 0.1) + 50.0
    still = 0.1 * rng.standard_normal(40)
    assert by_lab({"rate": 0.0, "walk": 0.0}, still, TIME, 0.1) > by_lab({"rate": 0.0, "walk": 0.1}, still, TIME, 0.1) + 5.0


@pytest.mark.parametrize(("rate", "sign", "least"), [(0.01, 1, 100.0), (0.0, -1, 10.0)])
def test_lab_samples_speak_for_a_drift_or_against_it(rate, sign, least):
    rng = np.random.default_rng(1)
    true, t = rng.standard_normal(1001), np.arange(1001.0)
    lab = np.full(1001, np.nan)
    at = np.linspace(5, 995, 40).astype(int)
    lab[at] = true[at] + 0.05 * rng.standard_normal(40)
    data = SimpleNamespace(y=true + rate * t + 0.1 * rng.standard_normal(1001))
    test = SimpleNamespace(lab=lab, data=data, lab_std=0.05, Ts=1.0)
    base = SimpleNamespace(theta={"noise_std": 0.1})
    gains = lab_gains([test], base, {"drift": {"rate": 0.01, "walk": 0.0}})
    assert sign * gains["drift"] > least


def test_without_lab_samples_or_a_fitted_drift_nothing_is_added():
    test = SimpleNamespace(lab=None)
    assert lab_gains([test], SimpleNamespace(), {"drift": {"rate": 1.0, "walk": 0.0}}) == {}
    assert lab_gains([], SimpleNamespace(), {}) == {}


def test_mv_is_what_the_valve_makes_of_op_within_the_digits_it_was_logged_in():
    rng = np.random.default_rng(2)
    op = 50.0 + np.cumsum(rng.standard_normal(200))
    mv = np.round(op, 1)
    mv[100:] += 0.5
    data = Data(op, op - 50.0, 1.0, 10.0, 2.0, 0.1)
    baseline = SimpleNamespace(valve=Part(name="ideal"), controller=SimpleNamespace(Kc=1.0))
    s = SimpleNamespace(data=data, op=op, baseline=baseline, record=SimpleNamespace(Ts=1.0, mv=mv), integrating=False)
    seen = joint_engine(s, [], {"stiction": (0.0, {})}).parts[0].data.u
    np.testing.assert_array_equal(seen[:100], op[:100])
    np.testing.assert_array_equal(seen[100:], mv[100:])

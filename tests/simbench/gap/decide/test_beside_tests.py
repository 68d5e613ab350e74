"""What tests add: lab samples tell a drifting measurement, a valve found by MV is known everywhere,
another plant is found.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench import Loop
from simbench.gap.decide.beside_tests import joint_engine, lab_rows, valve_maps
from simbench.gap.decide.evidence import LAB, PV, Evidence
from simbench.gap.effects import recogniser
from simbench.gap.intake.check import check
from simbench.gap.likelihood.model import Data
from simbench.scenarios.parts import Part

by_lab = recogniser("drift").by_lab
TIME = np.linspace(0.0, 1000.0, 40)


def test_a_walk_is_likelier_under_its_size_and_noise_under_none():
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.standard_normal(40)) * np.sqrt(TIME[1]) * 0.1
    assert (
        by_lab({"rate": 0.0, "walk": 0.1}, walk, TIME, 0.1)
        > by_lab({"rate": 0.0, "walk": 0.0}, walk, TIME, 0.1) + 50.0
    )
    still = 0.1 * rng.standard_normal(40)
    assert (
        by_lab({"rate": 0.0, "walk": 0.0}, still, TIME, 0.1)
        > by_lab({"rate": 0.0, "walk": 0.1}, still, TIME, 0.1) + 5.0
    )


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
    fitted = Evidence("drift", PV, 50.0, {"rate": 0.01, "walk": 0.0})
    [row] = lab_rows([test], base, [fitted, Evidence("noise", PV, 9.0)])
    assert (row.effect, row.source) == ("drift", LAB)
    assert sign * row.nats > least


def test_without_lab_samples_or_a_fitted_drift_nothing_is_added():
    test = SimpleNamespace(lab=None)
    drift = Evidence("drift", PV, 9.0, {"rate": 1.0, "walk": 0.0})
    assert lab_rows([test], SimpleNamespace(), [drift]) == []
    assert lab_rows([], SimpleNamespace(), [drift]) == []


def test_mv_is_what_the_valve_makes_of_op_within_the_digits_it_was_logged_in():
    rng = np.random.default_rng(2)
    op = 50.0 + np.cumsum(rng.standard_normal(200))
    mv = np.round(op, 1)
    mv[100:] += 0.5
    data = Data(op, op - 50.0, 1.0, 10.0, 2.0, 0.1)
    baseline = SimpleNamespace(
        valve=Part(name="ideal"), controller=SimpleNamespace(Kc=1.0), effect=()
    )
    record = SimpleNamespace(Ts=1.0, mv=mv)
    s = SimpleNamespace(data=data, op=op, baseline=baseline, record=record, integrating=False)
    seen = joint_engine(s, [], {"stiction": (0.0, {})}).parts[0].data.u
    np.testing.assert_array_equal(seen[:100], op[:100])
    np.testing.assert_array_equal(seen[100:], mv[100:])
    # MV that was logged before OP had moved is the valve's a moment later
    record.mv = np.round(op - 0.8 * np.diff(op, prepend=op[0]), 3)
    seen = joint_engine(s, [], {"stiction": (0.0, {})}).parts[0].data.u
    np.testing.assert_array_equal(seen, op)


MORE = {
    "controller": {"type": "PI", "Kc": 1, "Ti": 20},
    "sampling": {"Ts": 1, "n": 800},
    "noise": {"std": 0.1},
}
MORE |= {"setpoint": {"steps": [[100, 55], [350, 48], [600, 53]]}}


def test_mv_strays_only_where_no_map_explains_all_its_records_together():
    loop = Loop(plant={"type": "foptd", "K": 1, "T": 20, "Td": 6}, **MORE)
    lags = loop.with_("effect", [{"name": "valve_lag", "tau": 2.0}])
    s = check(lags.simulate(3).record, loop)
    rng = np.random.default_rng(4)

    def recorded(n, spread):
        op = 50.0 + np.cumsum(rng.standard_normal(n))
        mv = op + spread * rng.standard_normal(n)
        return SimpleNamespace(op=op, mv=mv, Ts=s.record.Ts)

    assert not valve_maps(s, [recorded(300, 0.1)])[1]
    # one short record that another map explains better counts by its length
    assert not valve_maps(s, [recorded(100, 0.2)])[1]
    assert valve_maps(s, [recorded(9000, 3.0)])[1]

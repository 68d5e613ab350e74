"""Each effect of the refinery follows its definition, on a record where that can be seen."""

from __future__ import annotations

import numpy as np
import pytest

from results.studies.worlds import refinery
from results.studies.worlds.refinery import loops, simulation
from results.studies.worlds.refinery.search import prepared


@pytest.fixture(scope="module")
def answer():
    """A plain foptd PI loop: white noise, wandering load, archive of full resolution, MV
    recorded.
    """
    rng = np.random.default_rng(12)
    classes = loops.draw_classes(rng, "foptd") | {
        "controller": "PI",
        "sp": "constant",
        "n": 3000,
        "averaging": False,
        "exceptions": False,
        "late": False,
        "known_play": False,
        "noise": "white",
        "load": "ou",
        "higher_order": False,
    }
    case = loops.draw_case(rng, classes)
    assert case is not None
    case["sensor"] = {"count": 0.0, "count_offset": 0.0}
    case["controller"]["op_step"] = 0.0
    case["archive"] |= {"places": dict.fromkeys(("sp", "op", "pv", "mv"), 12), "style": "digits"}
    case["mv"] = True
    return {"case": case}


def record(answer, effect=None, **parameters):
    return refinery.simulate(
        answer, [{"effect": effect, "parameters": parameters}] if effect else [], 3
    )


@pytest.mark.parametrize("effect", ["quantisation", "compression", "outliers"])
def test_effects_of_the_archive_leave_the_loop_alone(answer, effect):
    parameters = {
        "quantisation": {"step": 1.0, "at": "record"},
        "compression": {"band": 1.0},
        "outliers": {"rate": 0.01, "size": 9.0},
    }
    plain, changed = record(answer), record(answer, effect, **parameters[effect])
    assert np.array_equal(plain["op"], changed["op"])
    assert not np.array_equal(plain["pv"], changed["pv"])


def test_valve_effects_stand_between_op_and_mv(answer):
    plain = record(answer)
    np.testing.assert_allclose(plain["mv"], plain["op"], atol=1e-9)
    c = answer["case"]["m0"]
    zone = record(answer, "deadzone", D=2.0, c=c)
    np.testing.assert_allclose(
        zone["mv"],
        c + np.sign(zone["op"] - c) * np.maximum(np.abs(zone["op"] - c) - 1.0, 0.0),
        atol=1e-9,
    )
    band = record(answer, "deadband", S=2.0)
    x = band["mv"][0]
    for u, v in zip(band["op"][1:], band["mv"][1:]):
        x = max(u - 1.0, min(u + 1.0, x))
        assert v == pytest.approx(x, abs=1e-9)
    trim = record(answer, "valve_characteristic", R=30.0)
    np.testing.assert_allclose(trim["mv"], 100 * (30 ** (trim["op"] / 100) - 1) / 29, atol=1e-8)
    lag = record(answer, "valve_lag", tau=25.0)
    a = np.exp(-answer["case"]["Ts"] / 25.0)
    np.testing.assert_allclose(
        lag["mv"][1:], a * lag["mv"][:-1] + (1 - a) * lag["op"][1:], atol=1e-8
    )


def test_plant_mismatches_change_one_number(answer):
    case = answer["case"]
    p = simulation.build(case).plant
    for effect, name, value, expected in (
        ("gain_mismatch", "K", {"factor": 1.7}, p.K * 1.7),
        ("time_constant_mismatch", "T", {"factor": 0.6}, p.T * 0.6),
        ("dead_time_mismatch", "Td", {"extra": 4.0}, p.Td + 4.0),
        ("dead_time_mismatch", "Td", {"extra": -1e6}, 0.0),
        ("extra_lag", "extra_lag", {"tau": 8.0}, 8.0),
    ):
        changed = prepared(case, [{"effect": effect, "parameters": value}]).plant
        assert changed == p._replace(**{name: expected})

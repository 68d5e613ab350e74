"""Sweeps take functions as detectors, and the ratios of the benchmark's axes as axes."""

import json
import math

import numpy as np
import pytest

import simbench as sb
from simbench.bench.execute.sweep import sweep
from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
        "valve": {"model": "choudhury", "S": 4.0, "J": 1.0},
        "sampling": {"Ts": 1.0, "n": 400},
        "setpoint": {"steps": [[10.0, 55.0]]},
    }
)


def never(record):
    """Answer no stiction."""
    return False


def test_functions_are_asked_beside_methods():
    table = sweep(LOOP, {"valve.S": [4.0, 6.0]}).rates([never, "horch"])
    assert table.method.tolist() == ["never", "horch", "never", "horch"]
    assert (table[table.method == "never"].stiction == 0.0).all()
    assert sweep(LOOP, {"valve.S": [4.0]}).rates(never).method.tolist() == ["never"]


def test_ratios_set_the_dead_time_and_the_slip_jump():
    axes = {"Td_over_T": [0.1, 0.5], "S_over_2J": [0, 0.5, math.inf]}
    verdicts = sweep(LOOP, axes).verdicts(never)
    loops = verdicts.loop.map(json.loads)
    assert loops.map(lambda x: x["plant"]["Td"]).tolist() == [1.0] * 3 + [5.0] * 3
    assert loops.map(lambda x: x["valve"].get("J", "none")).tolist() == ["none", 4.0, 0.0] * 2
    assert loops.map(lambda x: x["valve"]["model"]).tolist()[0] == "ideal"
    assert verdicts.S_over_2J.tolist() == [0.0, 0.5, math.inf] * 2
    assert verdicts.sticky.tolist() == [False, True, True] * 2
    assert loops.map(lambda x: x["controller"]["Kc"]).eq(1.0).all()


def test_the_scores_of_ratios_say_who_sees_what():
    table = sweep(LOOP, {"S_over_2J": [0, 1.0]}, seeds=2).rates("he").set_index("S_over_2J")
    assert table.cycling.to_dict() == {0.0: 0.0, 1.0: 1.0}
    assert np.isfinite(table.accuracy).all()


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"Td_over_T": [-1.0]}, "value -1; 0 to"),
        ({"Td_over_T": ["x"]}, "numbers are needed"),
        ({"S_over_2J": [1.0], "valve": [{"model": "deadzone", "d": 1.0}]}, "valve with S > 0"),
    ],
)
def test_impossible_ratios_are_one_sentence(axes, words):
    with pytest.raises(SpecError, match=words):
        sweep(LOOP, axes).rates("he")


def test_a_dead_time_of_integral_times_needs_one():
    proportional = LOOP.with_all({"controller": {"type": "P", "Kc": 1.0}})
    with pytest.raises(SpecError, match=r"controller\.Ti"):
        sweep(proportional, {"Td_over_Ti": [0.1]}).rates("he")


def test_a_sweep_is_scored_and_run_like_a_grid(tmp_path):
    made = sweep(LOOP, {"valve.S": [4.0, 6.0]}, seeds=2)
    scores = made.score(["he", never])
    folder = sb.run(made, ["he", never], out=tmp_path / "run")
    again = sb.score(folder)
    assert repr(scores) == repr(again)
    assert scores.as_json()["rows"] == again.as_json()["rows"]
    rates = scores.along("valve.S")
    assert rates["valve.S"].tolist() == ["4", "4", "6", "6"]
    assert rates.n.tolist() == [2] * 4

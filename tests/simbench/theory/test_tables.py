"""Table 11.3 and its conditions; what the benchmark's truth columns hold; what `predict`
answers.
"""

import json

import pytest

from simbench.theory.cycle import exact_cycle
from simbench.theory.predict import as_text, predict
from simbench.theory.sampled import sampled_loop, ultimate_gain
from simbench.theory.table_check import _loops_of_cell, check_table_11_3
from simbench.theory.tables import TABLE_11_2, TABLE_11_3, refined, table_11_3, truth_columns

EIGHT = [
    ({"Ti": None, "Kc": 4, "J": 0}, False, False),
    ({"Ti": None, "Kc": 2}, False, False),
    ({"Ti": None, "Kc": 4}, False, True),
    ({"J": 0}, False, False),
    ({"J": 0, "Ti": 2.5, "Kc": 1.6}, False, True),
    ({}, True, True),
    ({"kind": "integrating", "K": 0.1, "Ti": None, "J": 0}, False, False),
    ({"kind": "integrating", "K": 0.1, "Ti": None}, True, True),
    ({"kind": "integrating", "K": 0.1, "Ti": 30, "J": 0}, True, True),
    ({"kind": "integrating", "K": 0.1, "Ti": 30}, True, True),
]


def test_tables_hold_the_printed_words():
    assert len(TABLE_11_3) == 8
    assert sum(TABLE_11_3.values()) == 4
    assert TABLE_11_3["self-regulating", "PI", "stick-slip"]
    assert not TABLE_11_3["integrating", "P", "dead-band"]
    assert TABLE_11_2["fast (flow)", "I"] == ("triangular (sharp)", "square")


def test_the_p_condition_is_exact(loop):
    for gain, expected in ((2.45, False), (2.55, True)):
        sampled = sampled_loop(loop(Ti=None, Kc=gain, J=2, Ts=0.05))
        cycle = exact_cycle(sampled)
        assert refined(sampled, cycle) == expected
        assert (cycle is not None) == expected


def test_healthy_valve_is_a_negative_of_every_column(loop):
    predicted, holds, theory = truth_columns(loop(valve={"model": "ideal"}, Ts=0.5))
    assert (predicted, holds, theory["exists"]) == (False, False, False)
    assert not table_11_3(sampled_loop(loop(S=0, J=0, Ts=0.5)))


def test_deadzone_has_no_cell_but_a_describing_function(loop):
    predicted, holds, theory = truth_columns(loop(valve={"model": "deadzone", "D": 5}, Ts=0.5))
    assert (predicted, holds) == (None, None)
    assert (theory["exists"], theory["by"]) == (False, "describing function")
    assert "deadzone" in theory["reason"]


@pytest.mark.parametrize(
    "effect", [{"name": "error_deadband", "width": 1.0}, {"name": "sensor_lag", "tau": 2.0}]
)
def test_what_theory_does_not_describe_is_said(loop, effect):
    predicted, holds, theory = truth_columns(loop(effect=[effect], Ts=0.5))
    assert (predicted, holds, theory["exists"]) == (None, None, None)
    assert theory["reason"].startswith("theory:")


def test_disturbances_and_noise_do_not_change_the_prediction(loop):
    more = {"noise": {"std": 1.0}, "disturbance": [{"type": "sine", "amplitude": 3, "period": 20}]}
    assert predict(loop(Ts=0.5)) == predict(loop(Ts=0.5, **more))


@pytest.mark.parametrize(
    "settings",
    [
        *(s for s, _, _ in EIGHT),
        {"valve": {"model": "deadzone", "D": 5}},
        {"valve": {"model": "ideal"}},
    ],
)
def test_prediction_has_the_contract_s_keys_and_is_json(loop, settings):
    prediction = json.loads(json.dumps(predict(loop(**settings, Ts=0.2))))
    assert list(prediction) == ["table_11_3", "refined", "describing_function", "exact", "reason"]
    assert all(
        set(f) == {"period", "amplitude", "stable"} for f in prediction["describing_function"]
    )
    assert prediction["exact"] is None or set(prediction["exact"]) == {
        "period",
        "amplitude",
        "kick_min",
    }
    text = as_text(prediction)
    assert text.startswith("Table 11.3")
    assert "None" not in text


def test_direct_acting_loop_is_predicted_like_its_mirror(loop):
    controller = {"type": "PI", "Kc": 1.0, "Ti": 10.0, "direction": "direct"}
    assert predict(loop(K=-1.0, controller=controller, Ts=0.5)) == predict(loop(Ts=0.5))


def test_checked_table_has_eight_cells_and_theory_meets_its_conditions():
    checks = check_table_11_3(load_steps=8, every=7, seed=3)
    assert [(c.process, c.controller, c.nonlinearity) for c in checks] == list(TABLE_11_3)
    for c in checks:
        assert c.conditions_right == c.loops
        assert c.reached <= c.exist <= c.loops
        assert sum(c.disagreements.values()) == (c.loops - c.exist if c.table else c.exist)
    assert checks[3].exist == checks[3].loops
    assert any("K Kc J > S" in condition for c in checks for condition in c.disagreements)


def test_the_table_is_checked_on_the_600_loops_that_are_stated():
    cells = {key: list(_loops_of_cell(*key)) for key in TABLE_11_3}
    assert [len(loops) for loops in cells.values()] == 2 * [15, 60, 45, 180]
    for process in ("self-regulating", "integrating"):
        loops = cells[process, "P", "stick-slip"]
        # 8 stands for the ultimate gain, which a loop without dead time does not have
        shares = [1 / ultimate_gain(x) if x.Td else abs(x.gain) / 8 for x in loops]
        stated = [share for share in (0.1, 0.3, 0.5, 0.7, 0.9) for _ in range(4)] * 3
        assert shares == pytest.approx(stated, rel=1e-6)
        assert [x.J / x.S for x in loops] == pytest.approx([0.2, 0.5, 1.0, 1.5] * 15)

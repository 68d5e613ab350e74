"""What a test may be expected to tell: information, the probability of a right answer, and when
nothing would.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.plan import expected
from simbench.gap.plan.expected import Expected, PlannedTests, _gained, plan

P = np.array([0.5, 0.3, 0.1])


def twice(nats):
    return np.repeat(np.asarray(nats, dtype=float)[None], 2, axis=0)


def trial(id_="bump"):
    about = {
        "size": 2.0,
        "hold_s": 60.0,
        "minutes": 9.0,
        "op_travel": 2.0,
        "settings": {"test": {"id": id_}},
    }
    return SimpleNamespace(id=id_, says=f"do {id_}", **about, run=lambda loop, seed: None)


def test_a_test_under_which_all_explain_the_same_tells_nothing():
    information, right = _gained(P, twice(np.zeros((3, 3))))
    assert information == pytest.approx(0.0, abs=1e-12)
    assert right == pytest.approx(0.5)


def test_a_test_that_parts_all_tells_all_that_was_open():
    information, right = _gained(P, twice(-100.0 * (1 - np.eye(3))))
    share = P / P.sum()
    assert information == pytest.approx(-share @ np.log(share), abs=1e-6)
    # what is not among the explanations stays wrong
    assert right == pytest.approx(0.9)


def test_the_json_of_a_plan_has_the_contracts_keys():
    nats = twice([[0, -100, 0], [-100, 0, 0], [0, 0, 0]])
    one = Expected(trial(), 3.0, 1.0, nats, 0.4, 0.8)
    made = PlannedTests(("stiction", "deadband", "none"), P, (one,), ("bump", "mv"), 0.85)
    answer = made.as_json()
    assert set(answer) == {"tests", "pair", "why"}
    assert {"id", "settings", "information", "p_right", "minutes", "pv_excursion"} <= set(
        answer["tests"][0]
    )
    assert answer["pair"] == ["bump", "mv"]
    assert made.separated(one) == ["stiction", "deadband"]
    next_test = {
        "test": "bump",
        "size": 2.0,
        "hold_s": 60.0,
        "p_right_after": 0.8,
        "says": "do bump",
    }
    assert made.next_test == next_test | {"separates": ["stiction", "deadband"]}
    assert "do bump" in made.as_text()


def stub(monkeypatch, nats):
    def sized(id_, *more):
        return (trial(id_), "", 3.0) if id_ in nats else (None, f"{id_}: no", 0.0)

    monkeypatch.setattr(expected, "sized", sized)
    monkeypatch.setattr(expected, "_nats", lambda one, *more: twice(nats[one.id]))
    s = SimpleNamespace(proven={})
    numbers = {"stiction": {"S": 2.0, "J": 1.0}, "deadband": {"S": 1.5}}
    about = {
        "chosen": ["stiction"],
        "valve_seen": False,
        "asked": (),
        "worst_test": (0.1, "process"),
    }
    return SimpleNamespace(situation=s, parameters=numbers, **about)


LEFT = {"stiction": 0.4, "unknown": 0.3, "none": 0.2, "valve_lag": 0.1}
OPEN = {"stiction": 0.5, "deadband": 0.45, "none": 0.05}
LOOPS = SimpleNamespace(loop=tuple)


def test_the_test_that_tells_most_comes_first_and_the_best_pair_tells_no_less(monkeypatch):
    def apart(a, b):
        out = np.zeros((3, 3))
        out[a, b] = out[b, a] = -60.0
        return out

    assessment = stub(
        monkeypatch, {"bump": apart(0, 1), "kc_half": np.zeros((3, 3)), "still": apart(0, 2)}
    )
    made = plan(assessment, OPEN, LOOPS)
    assert made.best.trial.id == "bump"
    assert set(made.pair) == {"bump", "still"}
    assert made.p_right >= made.best.p_right
    assert "mv: no" in made.left_out


def test_where_no_test_would_tell_that_is_the_answer(monkeypatch):
    assessment = stub(monkeypatch, {"bump": np.zeros((3, 3)), "still": np.zeros((3, 3))})
    made = plan(assessment, OPEN, LOOPS)
    assert made.next_test is None
    assert made.pair == ()
    assert "no test on the menu" in made.as_json()["why"]


def test_what_the_record_itself_shows_needs_no_test(monkeypatch):
    assessment = stub(monkeypatch, {"bump": np.zeros((3, 3))})
    assessment.situation.proven = {"stiction": {}}
    assert "no test would tell more" in plan(assessment, {"stiction": 0.9, "none": 0.1}, LOOPS).why


@pytest.mark.parametrize("shown", [False, True])
def test_a_second_effect_named_by_likelihood_alone_next_to_a_proven_law_is_asked_for(
    monkeypatch, shown
):
    assessment = stub(monkeypatch, {"bump": -60.0 * (1 - np.eye(3))})
    assessment.situation.proven, assessment.chosen, assessment.shown = (
        {"detuning": {}},
        ["detuning", "stiction"],
        lambda effect: shown,
    )
    gains = {"detuning": 1000.0, "stiction": 13.0, "deadband": 12.0}
    assessment.log_likelihood_gains, assessment.log_likelihood_gains_on_top = gains, {}
    simulated = []
    made = plan(
        assessment, {"detuning": 0.8, "stiction": 0.2}, SimpleNamespace(loop=simulated.append)
    )
    if shown:
        assert "detuning is shown by the record itself" in made.why
        return
    assert made.next_test["test"] == "bump"
    assert made.effects == ("stiction", "deadband", "none")
    assert simulated == [["detuning", "stiction"], ["detuning", "deadband"], ["detuning"]]


def test_a_test_that_was_run_is_not_asked_for_again(monkeypatch):
    assessment = stub(monkeypatch, {"bump": -60.0 * (1 - np.eye(3))})
    assessment.asked = ("bump",)
    assert plan(assessment, OPEN, LOOPS).tests == ()


def test_unknown_by_single_samples_or_the_law_has_no_test_that_would_change_it(monkeypatch):
    assessment = stub(monkeypatch, {"bump": -60.0 * (1 - np.eye(3))})
    assessment.worst_test, assessment.unexplained = (10.0, "valve"), {"valve": "MV strays"}
    made = plan(assessment, {"unknown": 0.83, "stiction": 0.12, "none": 0.05}, LOOPS)
    assert made.next_test is None
    assert "MV strays" in made.why


def test_of_another_unknown_a_test_leaves_less_to_the_known(monkeypatch):
    assessment = stub(monkeypatch, {})
    believed, unknown = expected._believed(assessment, LEFT)
    assert unknown < LEFT["unknown"]
    assert unknown + sum(believed.values()) == pytest.approx(1.0)
    assert believed["stiction"] / believed["none"] == pytest.approx(2.0)


def test_what_a_failed_simulation_refuted_is_believed_again(monkeypatch):
    assessment = stub(monkeypatch, {})
    believed, unknown = expected._believed(
        assessment, {"unknown": 0.7, "stiction": 0.0, "none": 0.3}
    )
    assert believed["stiction"] > unknown


def test_what_gives_the_same_signals_is_left_however_unlikely_it_was_called(monkeypatch):
    assessment = stub(monkeypatch, {})
    believed, _ = expected._believed(
        assessment, {"stiction": 0.85, "none": 0.149, "deadband": 0.001}
    )
    assert believed["deadband"] > 0.03
    assert sum(believed.values()) == pytest.approx(1.0)


def test_the_test_that_observes_an_explanation_by_itself_tells_it(monkeypatch):
    assessment = stub(
        monkeypatch, {"mv": np.zeros((3, 3)), "lab": np.zeros((3, 3)), "bump": np.zeros((3, 3))}
    )
    made = plan(
        assessment,
        {"none": 0.5, "stiction": 0.15, "deadband": 0.15, "valve_lag": 0.1, "drift": 0.1},
        LOOPS,
        most=3,
    )
    right = {x.trial.id: x.p_right for x in made.tests}
    assert right["mv"] == pytest.approx(right["bump"] + 0.1)
    assert right["lab"] == pytest.approx(right["bump"] + 0.1)


def test_a_slow_load_however_sure_asks_for_lab_samples_which_alone_tell_it_from_a_drift(
    monkeypatch,
):
    assessment = stub(monkeypatch, {"lab": -60.0 * (1 - np.eye(2))})
    assessment.parameters, assessment.chosen = {"load_steps": {}, "drift": {}}, ["load_steps"]
    likely = {"load_steps": 0.93, "none": 0.05, "drift": 0.02}
    assert plan(assessment, likely, LOOPS, most=2).best.trial.id == "lab"
    assessment.asked = ("lab",)
    assert "no further test is recommended" in plan(assessment, likely, LOOPS, most=2).why


def test_a_plan_that_asks_nothing_explains_why_and_draws_no_table():
    assert (
        PlannedTests(("stiction",), np.ones(1), (), (), 0.97, "stiction is plain").as_text()
        == "stiction is plain"
    )

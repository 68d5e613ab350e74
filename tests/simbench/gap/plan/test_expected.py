"""What a test may be expected to tell: information, the probability of a right answer, and when nothing would."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.plan import expected
from simbench.gap.plan.expected import Expected, PlannedTests, _told, plan

P = np.array([0.5, 0.3, 0.1])


def told(nats):
    return np.repeat(np.asarray(nats, dtype=float)[None], 2, axis=0)


def trial(id_="bump"):
    about = {"size": 2.0, "hold_s": 60.0, "minutes": 9.0, "op_travel": 2.0, "settings": {"test": {"id": id_}}}
    return SimpleNamespace(id=id_, says=f"do {id_}", **about, run=lambda loop, seed: None)


def test_a_test_under_which_all_explain_the_same_tells_nothing():
    information, right = _told(P, told(np.zeros((3, 3))))
    assert information == pytest.approx(0.0, abs=1e-12)
    assert right == pytest.approx(0.5)


def test_a_test_that_parts_all_tells_all_that_was_open():
    information, right = _told(P, told(-100.0 * (1 - np.eye(3))))
    share = P / P.sum()
    assert information == pytest.approx(-share @ np.log(share), abs=1e-6)
    # what is not among the explanations stays wrong
    assert right == pytest.approx(0.9)


def test_what_a_plan_says_has_the_contracts_keys():
    nats = told([[0, -100, 0], [-100, 0, 0], [0, 0, 0]])
    one = Expected(trial(), 3.0, 1.0, nats, 0.4, 0.8)
    made = PlannedTests(("stiction", "deadband", "none"), P, (one,), ("bump", "mv"), 0.85)
    said = made.as_json()
    assert set(said) == {"tests", "pair", "why"}
    assert {"id", "settings", "information", "p_right", "minutes", "pv_excursion"} <= set(said["tests"][0])
    assert said["pair"] == ["bump", "mv"]
    assert made.separated(one) == ["stiction", "deadband"]
    next_test = {"test": "bump", "size": 2.0, "hold_s": 60.0, "p_right_after": 0.8, "says": "do bump"}
    assert made.next_test == next_test | {"separates": ["stiction", "deadband"]}
    assert "do bump" in made.as_text()


def stub(monkeypatch, nats):
    def sized(id_, *more):
        return (trial(id_), "", 3.0) if id_ in nats else (None, f"{id_}: no", 0.0)

    monkeypatch.setattr(expected, "sized", sized)
    monkeypatch.setattr(expected, "_nats", lambda one, *more: told(nats[one.id]))
    s = SimpleNamespace(proven={})
    numbers = {"stiction": {"S": 2.0, "J": 1.0}, "deadband": {"S": 1.5}}
    return SimpleNamespace(situation=s, parameters=numbers, chosen=["stiction"], valve_seen=False, asked=(), worst_test=(0.1, "process"))


OPEN = {"stiction": 0.5, "deadband": 0.45, "none": 0.05}
LOOPS = SimpleNamespace(loop=tuple)


def test_the_test_that_tells_most_comes_first_and_the_best_pair_tells_no_less(monkeypatch):
    def apart(a, b):
        out = np.zeros((3, 3))
        out[a, b] = out[b, a] = -60.0
        return out

    found = stub(monkeypatch, {"bump": apart(0, 1), "kc_half": np.zeros((3, 3)), "still": apart(0, 2)})
    made = plan(found, OPEN, LOOPS)
    assert made.best.trial.id == "bump"
    assert set(made.pair) == {"bump", "still"}
    assert made.p_right >= made.best.p_right
    assert "mv: no" in made.left_out


def test_where_no_test_would_tell_that_is_the_answer(monkeypatch):
    found = stub(monkeypatch, {"bump": np.zeros((3, 3)), "still": np.zeros((3, 3))})
    made = plan(found, OPEN, LOOPS)
    assert made.next_test is None
    assert made.pair == ()
    assert "no test on the menu" in made.as_json()["why"]


def test_what_the_record_itself_shows_needs_no_test(monkeypatch):
    found = stub(monkeypatch, {"bump": np.zeros((3, 3))})
    found.situation.proven = {"stiction": {}}
    assert "no test would tell more" in plan(found, {"stiction": 0.9, "none": 0.1}, LOOPS).why


def test_a_test_that_was_run_is_not_asked_for_again(monkeypatch):
    found = stub(monkeypatch, {"bump": -60.0 * (1 - np.eye(3))})
    found.asked = ("bump",)
    assert plan(found, OPEN, LOOPS).tests == ()

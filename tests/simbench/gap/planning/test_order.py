"""Which test comes next: a fixed order of what was not recorded yet, and when none is needed."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import Refusal
from simbench.gap.planning import order
from simbench.gap.planning.menu import Trial
from simbench.gap.planning.order import ORDER, PlannedTests, plan

OPEN = {"stiction": 0.5, "deadband": 0.45, "none": 0.05}
LOOPS = SimpleNamespace(loop=tuple)


def trial(id_="bump"):
    still = np.zeros(540)
    return Trial(id_, 2.0, 60.0, 1.0, still, True, pv_excursion=3.0)


def assessed(monkeypatch, left_out=(), asked=(), known=False, faithful=True, strays="", **more):
    seen = {}

    def sized(id_, s, loops, band, limits):
        seen.update(loops=loops, band=band)
        return Refusal(f"{id_}: no") if id_ in left_out else trial(id_)

    monkeypatch.setattr(order, "size_test", sized)
    situation = SimpleNamespace(
        proven={},
        law=SimpleNamespace(known=known),
        archive=SimpleNamespace(faithful=faithful),
        unexplained_law=strays,
        record=SimpleNamespace(S_unit="OP units"),
    )
    numbers = {"stiction": {"S": 2.0, "J": 1.0}, "deadband": {"S": 1.5}}
    about = {
        "situation": situation,
        "parameters": numbers,
        "chosen": ["stiction"],
        "valve_seen": False,
        "asked": asked,
        "unexplained": {},
        "shown": lambda effect: False,
        "seen": seen,
    }
    return SimpleNamespace(**(about | more))


def ids(planned):
    return [x.id for x in planned.tests]


def test_a_plan_states_the_unit_of_op(monkeypatch):
    made = order.plan(assessed(monkeypatch), {"stiction": 0.5, "none": 0.5}, LOOPS)
    assert "OP moves by (OP units)" in made.as_text()


def test_the_json_of_a_plan_has_the_contracts_keys_and_claims_no_information():
    made = PlannedTests((trial("mv"), trial()))
    answer = made.as_json()
    assert set(answer) == {"tests", "pair", "why"}
    assert answer["tests"][0] == {
        "id": "mv",
        "settings": {"test": {"id": "mv", "size": 2.0, "hold_s": 60.0}},
        "information": None,
        "p_right": None,
        "minutes": 9.0,
        "pv_excursion": 3.0,
    }
    assert answer["pair"] == ["mv", "bump"]
    assert made.next_test == {
        "test": "mv",
        "size": 2.0,
        "hold_s": 60.0,
        "settings": {"test": {"id": "mv", "size": 2.0, "hold_s": 60.0}},
        "says": made.tests[0].says,
    }
    assert made.as_text().startswith(
        f"Next test, mv: {made.tests[0].says}; if the answer stays open, bump is next."
    )


def test_mv_comes_first_then_sp_and_what_was_recorded_is_not_asked_for_again(monkeypatch):
    assert ids(plan(assessed(monkeypatch), OPEN, LOOPS))[:2] == ["mv", "sp_steps"]
    assert ids(plan(assessed(monkeypatch, valve_seen=True), OPEN, LOOPS))[0] == "sp_steps"
    again = plan(assessed(monkeypatch, asked=("mv", "sp_steps")), OPEN, LOOPS, most=1)
    assert ids(again) == ["lab"]
    assert plan(assessed(monkeypatch, asked=ORDER), OPEN, LOOPS).next_test is None


@pytest.mark.parametrize(
    ("known", "faithful", "strays", "first"),
    [
        (True, False, "", "mv"),
        (False, True, "", "mv"),
        (False, False, "", "raw"),
        (True, True, "OP strays", "raw"),
    ],
)
def test_raw_data_come_first_where_neither_law_nor_samples_speak_for_the_archive(
    monkeypatch, known, faithful, strays, first
):
    assessment = assessed(monkeypatch, known=known, faithful=faithful, strays=strays)
    assert plan(assessment, OPEN, LOOPS).next_test["test"] == first


def test_a_test_that_would_leave_its_limits_is_left_out_with_its_reason(monkeypatch):
    made = plan(assessed(monkeypatch, left_out=("mv",)), OPEN, LOOPS)
    assert made.pair == ["sp_steps", "lab"]
    assert made.left_out == ("mv: no",)
    nothing = plan(assessed(monkeypatch, left_out=ORDER), OPEN, LOOPS)
    assert nothing.as_json()["pair"] == []
    assert "leaves its limits" in nothing.sentence()


def test_tests_are_sized_on_the_loops_of_the_likeliest_explanations(monkeypatch):
    assessment = assessed(monkeypatch)
    plan(assessment, OPEN, LOOPS, most=1)
    assert assessment.seen["loops"] == {
        "stiction": ("stiction",),
        "deadband": ("deadband",),
        "none": (),
    }
    # of the two frictions that may be there the narrower
    assert assessment.seen["band"] == 1.5


def test_what_the_record_itself_shows_or_is_nearly_sure_needs_no_test(monkeypatch):
    assessment = assessed(monkeypatch)
    assert "0.93" in plan(assessment, {"stiction": 0.93, "none": 0.07}, LOOPS).why
    assessment.situation.proven = {"stiction": {}}
    assert (
        "the record itself shows stiction" in plan(assessment, OPEN | {"stiction": 0.6}, LOOPS).why
    )


@pytest.mark.parametrize("shown", [False, True])
def test_a_second_effect_named_by_likelihood_alone_is_asked_for_however_sure_the_first_is(
    monkeypatch, shown
):
    assessment = assessed(monkeypatch, chosen=["detuning", "stiction"], shown=lambda effect: shown)
    assessment.situation.proven = {"detuning": {}}
    made = plan(assessment, {"detuning": 0.95, "stiction": 0.05}, LOOPS)
    assert (made.next_test is None) == shown


def test_unknown_is_asked_about_until_a_log_without_archive_shows_no_known_controller(monkeypatch):
    unknown = {"unknown": 0.95, "stiction": 0.05}
    strays = {"valve": "MV strays"}
    assert plan(assessed(monkeypatch, unexplained=strays), unknown, LOOPS).next_test is not None
    law = {"controller": "OP stands still"}
    strange = assessed(monkeypatch, unexplained=law, strays="OP stands still")
    assert plan(strange, unknown, LOOPS).next_test["test"] == "raw"
    strange.asked = ("raw",)
    assert "OP stands still" in plan(strange, unknown, LOOPS).why
    assert plan(assessed(monkeypatch, unexplained=law), OPEN, LOOPS).next_test is not None

"""Table 11.1: what a loop is made of is what is measured, and the limits are the printed ones."""

import json

import pytest

from simbench.confirm.grade import grade, graded_test


def by_name(loop):
    return {g.parameter.split(" (")[0]: g for g in grade(loop)}


@pytest.mark.parametrize(
    ("K", "ok"), [(0.45, False), (0.55, True), (-1.0, True), (2.9, True), (3.1, False)]
)
def test_the_process_gain_is_the_plants(loop, K, ok):
    row = by_name(loop(K=K, S=0.3, J=0.3))["process gain"]
    assert row.value == pytest.approx(abs(K), rel=0.04)
    assert row.acceptable == ok


@pytest.mark.parametrize(
    ("S", "J", "ok"), [(3.0, 0.5, True), (3.0, 0.8, True), (3.0, 1.1, False), (8.0, 4.0, False)]
)
def test_stiction_is_the_slip_jump_up_to_a_step(loop, S, J, ok):
    row = by_name(loop(S=S, J=J))["stiction"]
    assert J - 1e-9 <= row.value <= J + 0.2 + 1e-9
    assert row.acceptable == ok


def test_what_a_loop_does_not_show_is_not_graded(loop):
    level = by_name(loop(kind="integrating", K=0.1))
    assert (level["process gain"].value, level["process gain"].acceptable) == (None, None)
    assert level["stiction"].acceptable is not None
    stuck = by_name(loop(S=100.0, J=50.0))
    assert stuck["stiction"].acceptable is stuck["process gain"].acceptable is None
    assert "did not answer" in stuck["stiction"].reason


def test_the_travel_test_of_a_loop_holds_its_grades(loop):
    graded = graded_test(loop(kind="integrating", K=0.1))
    answer = json.loads(json.dumps(graded.as_json()))
    assert [g["acceptable"] for g in answer["table_11_1"]] == [None, True, True, False]
    assert {"S", "J", "sticky"} <= set(answer)
    assert all(words in graded.as_text() for words in ("cannot tell", "to be checked"))
    assert len(graded.plot().axes) == 2

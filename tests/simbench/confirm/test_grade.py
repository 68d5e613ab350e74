"""Table 11.1: what a loop is made of is what is measured, and the limits are the printed ones."""

import json

import pytest

from simbench.confirm.grade import GAIN_LIMIT, HYSTERESIS, NOISE, STICTION_LIMIT, grade, graded_test


def by_name(loop):
    return {g.parameter.split(" (")[0]: g for g in grade(loop)}


@pytest.mark.parametrize(
    ("K", "ok"), [(0.45, False), (0.55, True), (-1.0, True), (2.9, True), (3.1, False)]
)
def test_the_process_gain_is_the_plants(loop, K, ok):
    found = by_name(loop(K=K, S=0.3, J=0.3))["process gain"]
    assert found.value == pytest.approx(abs(K), rel=0.04)
    assert found.acceptable == ok


@pytest.mark.parametrize(("std", "ok"), [(0.0, True), (0.1, True), (0.15, False)])
def test_the_noise_band_is_four_standard_deviations(loop, std, ok):
    found = by_name(loop(noise=std))["noise band"]
    assert found.value == pytest.approx(4 * std, rel=0.3, abs=1e-12)
    assert found.acceptable == ok


@pytest.mark.parametrize(
    ("S", "J", "ok"), [(3.0, 0.5, True), (3.0, 0.8, True), (3.0, 1.1, False), (8.0, 4.0, False)]
)
def test_stiction_is_the_slip_jump_up_to_a_step(loop, S, J, ok):
    found = by_name(loop(S=S, J=J))["stiction"]
    assert J - 1e-9 <= found.value <= J + 0.2 + 1e-9
    assert found.acceptable == ok


def test_hysteresis_is_what_is_left_without_the_dead_band(loop):
    for H in (1.0, 2.5, 4.0):
        found = by_name(loop(valve={"model": "hysteresis", "S": 0.5, "H": H}))["hysteresis"]
        assert found.value == pytest.approx(H, abs=0.3)
        assert found.acceptable == (H <= 3.0)
    for wide in (1.0, 10.0):
        assert by_name(loop(valve={"model": "deadband", "S": wide}))[
            "hysteresis"
        ].value == pytest.approx(0.0, abs=0.15)


def test_what_a_loop_does_not_tell_is_not_graded(loop):
    level = by_name(loop(kind="integrating", K=0.1))
    assert (level["process gain"].value, level["process gain"].acceptable) == (None, None)
    assert level["stiction"].acceptable is not None
    stuck = by_name(loop(S=100.0, J=50.0))
    assert stuck["stiction"].acceptable is stuck["process gain"].acceptable is None
    assert "did not answer" in stuck["stiction"].reason


def test_the_limits_are_those_of_the_table():
    assert [(x.low, x.high) for x in (GAIN_LIMIT, NOISE, HYSTERESIS, STICTION_LIMIT)] == [
        (0.5, 3.0),
        (0.0, 0.5),
        (0.0, 3.0),
        (0.0, 1.0),
    ]


def test_the_travel_test_of_a_loop_says_its_grades(loop):
    found = graded_test(loop(kind="integrating", K=0.1))
    told = json.loads(json.dumps(found.as_json()))
    assert [g["acceptable"] for g in told["table_11_1"]] == [None, True, True, False]
    assert {"S", "J", "sticky"} <= set(told)
    text = found.as_text()
    assert "cannot tell" in text
    assert "to be checked" in text
    assert len(found.plot().axes) == 2

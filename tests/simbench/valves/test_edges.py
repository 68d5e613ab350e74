"""Where a valve begins to move, when its friction changes, and which numbers it just allows."""

import numpy as np
import pytest

from simbench.detectors.errors import ParameterError
from simbench.loop.response import valve_response

BAND = {"S": 4.0, "J": 2.0}
STICKY = {
    "asymmetric": {"S_up": 4.0, "J_up": 2.0, "S_down": 3.0, "J_down": 1.0},
    "intermittent": BAND | {"period": 9.0, "on": 9.0},
    "time_varying": BAND | {"t_end": 5.0},
}


@pytest.mark.parametrize(
    "name", ["choudhury", "choudhury_literal", "kano", "he", "time_varying", "intermittent"]
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_first_move_from_rest_needs_half_of_S_plus_J(name, way):
    # the flow chart as printed waits for all of S
    reach = 4.0 if name == "choudhury_literal" else 3.0
    before, after = (
        valve_response(name, 50.0 + way * np.array([0.0, reach + d]), STICKY.get(name, BAND))[1]
        for d in (-0.01, 0.01)
    )
    assert before == 50.0
    assert after == pytest.approx(50.0 + way * (reach + 0.01 - 1.0))


def test_either_way_of_an_asymmetric_valve_has_its_own_break_away_and_offset():
    table = STICKY["asymmetric"]  # up: 3 to break away, then 1 short; down: 2, then 1
    assert valve_response("asymmetric", [50, 53, 53.01], table).tolist() == pytest.approx(
        [50, 50, 52.01]
    )
    assert valve_response("asymmetric", [50, 48, 47.99], table).tolist() == pytest.approx(
        [50, 50, 48.99]
    )
    table = {"S_up": 5.0, "J_up": 1.0, "S_down": 3.0, "J_down": 2.0}
    assert valve_response("asymmetric", [50, 60, 70], table).tolist() == pytest.approx([50, 58, 68])
    assert valve_response("asymmetric", [50, 40, 30], table).tolist() == pytest.approx(
        [50, 40.5, 30.5]
    )


def test_a_spell_begins_at_its_delay_and_ends_after_its_length():
    table = {"S": 4.0, "J": 2.0, "period": 5.0, "on": 2.0, "delay": 1.0}
    op = 50.0 + np.arange(12) * 2.0  # 2 % per s: it sticks at t = 1, 2, 6, 7, 11
    lag = op - valve_response("intermittent", op, table)
    assert (lag > 0.0).tolist() == [t in (1, 2, 6, 7, 11) for t in range(12)]


def test_friction_that_changes_in_time_is_halfway_there_at_half_time():
    table = {"S": 2.0, "J": 0.0, "S_end": 6.0, "J_end": 2.0, "t_begin": 2.0, "t_end": 6.0}
    op = 10.0 + 5.0 * np.arange(9)
    lag = op - valve_response("time_varying", op, table)  # (S - J)/2 from the first move on
    assert lag.tolist() == pytest.approx([0, 1, 1, 1.25, 1.5, 1.75, 2, 2, 2])
    constant = {"S": 4.0, "J": 2.0, "t_end": 5.0}
    np.testing.assert_array_equal(
        valve_response("time_varying", op, constant),
        valve_response("choudhury", op, {"S": 4.0, "J": 2.0}),
    )


def test_eight_plays_of_a_hysteresis_open_one_after_the_other():
    table = {"S": 2.0, "H": 7.0}  # half bands 1, 2 ... 8
    for rise in (0.0, 1.0, 3.5, 8.0, 20.0):
        moved = np.mean([max(rise - half, 0.0) for half in range(1, 9)])
        assert valve_response("hysteresis", [40.0, 40.0 + rise], table)[1] == pytest.approx(
            40.0 + moved
        )


@pytest.mark.parametrize(
    ("name", "allowed", "refused"),
    [
        ("intermittent", {"S": 1.0, "J": 0.0, "period": 3.0, "on": 3.0}, {"on": 3.01}),
        ("hysteresis", {"S": 40.0, "H": 30.0}, {"S": 40.1}),
        ("limits", {"low": 40.0, "high": 40.1}, {"high": 40.0}),
        ("time_varying", {"S": 1.0, "J": 0.0, "t_begin": 2.0, "t_end": 2.01}, {"t_end": 2.0}),
        ("gain_ratio", {"R": 0.01}, {"R": 0.0099}),
        ("gain_ratio", {"R": 100.0}, {"R": 100.1}),
        ("characteristic", {"type": "equal_percentage", "R": 1.01}, {"R": 1.0}),
        ("characteristic", {"type": "linear", "authority": 1.0}, {"authority": 1.01}),
    ],
)
def test_the_last_value_allowed_and_the_first_refused(name, allowed, refused):
    assert valve_response(name, [50.0], allowed).size == 1
    with pytest.raises(ParameterError):
        valve_response(name, [50.0], {**allowed, **refused})


def test_a_gain_ratio_is_the_ratio_of_the_slopes_at_either_end():
    for R in (0.1, 1.0, 4.0):
        mv = valve_response("gain_ratio", [0.0, 0.001, 99.999, 100.0], {"R": R})
        assert mv[[0, 3]].tolist() == pytest.approx([0.0, 100.0])
        assert (mv[3] - mv[2]) / (mv[1] - mv[0]) == pytest.approx(R, rel=1e-3)

"""Valve travel test: S and J of known valves within one small step."""

import pytest

from simbench.confirm.travel import travel_test

PLANTS = [
    {},
    {"kind": "integrating", "K": 0.1},
    {"K": -2.0, "noise": 0.1},
    {"kind": "integrating", "K": 0.1, "noise": 0.05},
]


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(("S", "J"), [(5, 2), (1.3, 1.1), (4, 0), (5, 7), (60, 3)])
def test_sums_of_small_steps_are_J_and_S_within_one_step(loop, plant, S, J):
    test = travel_test(loop(S=S, J=J, **plant))
    assert J - 1e-9 <= test.J <= J + 0.2 + 1e-9
    assert S - 1e-9 <= test.S <= S + 0.2 + 1e-9
    assert test.sticky


@pytest.mark.parametrize(
    ("valve", "S", "J"),
    [
        ({"model": "kano", "S": 5, "J": 2}, 5, 2),
        ({"model": "he", "S": 5, "J": 2}, 5, 2),
        ({"model": "coulomb", "S": 5, "J": 2}, 5, 2),
        ({"model": "stenman", "d": 3}, 3, 3),
    ],
)
def test_other_friction_models_show_their_mapped_numbers(loop, valve, S, J):
    test = travel_test(loop(valve=valve))
    assert (test.J, test.S) == pytest.approx((J, S), abs=0.21)


@pytest.mark.parametrize("valve", [{"model": "ideal"}, {"model": "deadzone", "D": 4.0}])
def test_a_valve_that_follows_small_steps_is_not_sticky(loop, valve):
    test = travel_test(loop(valve=valve))
    assert not test.sticky
    assert (test.J, test.S) == (0.2, 0.2)


@pytest.mark.parametrize(
    ("S", "J", "reason"), [(100.0, 50.0, "did not answer"), (95.0, 3.0, "limit")]
)
def test_a_stuck_valve_or_one_that_needs_more_travel_has_no_numbers(loop, S, J, reason):
    test = travel_test(loop(S=S, J=J))
    assert test.as_json()["S" if J == 50.0 else "J"] is None
    assert J != 50.0 or test.sticky is None
    assert reason in test.reason
    assert "not measured" in test.as_text()

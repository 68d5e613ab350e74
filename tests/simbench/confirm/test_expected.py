"""What simulations of a changed gain expect, and when that tells nothing."""

import numpy as np
import pytest

from simbench.confirm.expected import Expected, Phase, kept
from simbench.confirm.gain_change import judge_change

BEFORE = Phase(1.0, 10.0, 1.0, False, 0.05)


def after(ratio):
    return Phase(0.6, 10.0 * ratio, 1.0, False, 0.1)


def expected(*ratios):
    """Simulations that change the period by these ratios, NaN where they stop."""
    return Expected(np.array([[np.log(r), 0.0] for r in ratios]), len(ratios))


SOUND, STICKY, STOPS = expected(1.35, 1.36, 1.37), expected(1.33, 1.34, 1.35), expected(np.nan)


@pytest.mark.parametrize(("ratio", "near"), [(1.667, False), (1.36, True), (1.0, False)])
def test_a_change_is_near_what_was_simulated_or_it_is_not(ratio, near):
    assert SOUND.near(BEFORE, after(ratio)) == near


def test_a_loop_that_stops_is_near_one_that_stops():
    stopped = Phase(0.6, np.nan, 0.0, False)
    assert STOPS.near(BEFORE, stopped)
    assert not SOUND.near(BEFORE, stopped)
    assert not STOPS.near(BEFORE, after(1.36))


def test_both_valves_are_alike_where_the_period_does_the_same():
    assert SOUND.alike(STICKY)
    assert not SOUND.alike(expected(1.1, 1.1))
    assert not SOUND.alike(STOPS)
    assert STOPS.alike(expected(np.nan, np.nan))


@pytest.mark.parametrize(
    ("odds", "stuck", "near", "verdict"),
    [
        (5.0, STICKY, True, "no_decision"),
        (5.0, expected(1.1, 1.1), True, "stiction"),
        (-5.0, expected(1.1, 1.1), True, "no_stiction"),
        (5.0, expected(1.1, 1.1), False, "no_decision"),
        (0.5, expected(1.1, 1.1), True, "no_decision"),
    ],
)
def test_a_change_far_from_both_or_alike_for_both_tells_nothing(odds, stuck, near, verdict):
    answer, reason = judge_change(odds, "Kc changed", SOUND, stuck, near)
    assert answer == verdict
    assert ("neither is near what was measured" in reason) == (not near)


@pytest.mark.parametrize(("ratio", "same"), [(1.05, True), (1.2, False), (np.nan, False)])
def test_an_oscillation_from_outside_keeps_its_period(ratio, same):
    assert kept(BEFORE, after(ratio)) == same

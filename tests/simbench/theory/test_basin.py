"""The smallest kick that starts a cycle."""

import pytest
from theory_check import kicks, simulated_cycle

from simbench.theory.basin import kick_min, starts_cycle
from simbench.theory.cycle import exact_cycle
from simbench.theory.sampled import sampled_loop


def test_smallest_kick_separates_rest_from_the_cycle_in_the_simulator(loop):
    asked = loop(Ts=0.5)
    sampled = sampled_loop(asked)
    kick = kick_min(sampled, exact_cycle(sampled))
    assert simulated_cycle(asked, kick=1.02 * kick) is not None
    assert simulated_cycle(asked, kick=0.98 * kick) is None


def test_a_kick_below_the_break_away_starts_nothing(loop):
    sampled = sampled_loop(loop(Ts=0.5))
    cycle = exact_cycle(sampled)
    assert not starts_cycle(sampled, cycle, 0.999 * sampled.fs)
    assert kick_min(sampled, cycle) >= sampled.fs


def test_a_p_controller_forgets_the_kick_so_that_none_may_start_the_cycle(loop):
    sampled = sampled_loop(loop(Ti=None, Td=3.15, Kc=1.38, J=4, Ts=0.2))
    cycle = exact_cycle(sampled)
    assert cycle is not None
    assert kick_min(sampled, cycle) is None


def test_no_kick_when_the_break_away_is_beyond_the_limit_of_op(loop):
    sampled = sampled_loop(loop(Ts=0.5))
    cycle = exact_cycle(sampled)
    assert kick_min(sampled_loop(loop(Ts=0.5, operating_point={"op0": 97})), cycle) is None


def test_predicted_kicks_hold_on_random_loops():
    assert kicks(12, seed=5) >= 11


@pytest.mark.parametrize("scale", [1, 4])
def test_smallest_kick_scales_with_the_valve(loop, scale):
    sampled = sampled_loop(loop(S=scale * 2.0, J=scale * 0.5, Ts=0.5))
    assert kick_min(sampled, exact_cycle(sampled)) / scale == pytest.approx(1.25, rel=0.3)

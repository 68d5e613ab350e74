"""Exact cycles: closed forms, golden simulations, stability, and what sampling does to them."""

import numpy as np
import pytest
from theory_check import simulated_cycle

from simbench.detectors.errors import ParameterError
from simbench.theory.cycle import cycle_start, exact_cycle, on_half_cycle
from simbench.theory.half_cycle import half_cycles
from simbench.theory.march import reversals
from simbench.theory.sampled import sampled_loop


def closed_form(k, Td, S, J):
    """Period and half peak-to-peak of OP for L(s) = k e^(-Td s)/s."""
    p = J / (2 - k * Td)
    return 2 * S / (k * p) + 2 * Td + k * Td**2, S / 2 + k * p * Td / 2


@pytest.mark.parametrize("J", [0.5, 2, 5, 7])
@pytest.mark.parametrize("Kc", [0.5, 1, 2])
def test_switching_times_give_the_closed_form_when_sampling_is_fast(loop, J, Kc):
    [half] = half_cycles(sampled_loop(loop(Kc=Kc, J=J, Ts=0.005)))
    period, amplitude = closed_form(Kc / 10, 2, 5, J)
    assert 2 * half.samples * 0.005 == pytest.approx(period, rel=1e-3)
    assert half.amplitude == pytest.approx(amplitude, rel=1e-3)
    # the valve's next swing is J - (1 - k Td) p
    assert half.multiplier == pytest.approx(1 - Kc / 10 * 2, abs=2e-3)


def test_integrating_p_loop_gives_the_closed_form(loop):
    cycle = exact_cycle(sampled_loop(loop("integrating", K=0.1, Kc=2, Ti=None, J=5, Ts=0.005)))
    assert (cycle.period, cycle.amplitude) == pytest.approx(closed_form(0.2, 2, 5, 5), rel=1e-3)


@pytest.mark.parametrize(
    ("settings", "period", "amplitude"),
    [
        ({"Td": 0.5, "Kc": 2, "Ti": 8, "J": 1}, 83.7867, 2.5352),
        ({"T": 3, "Td": 6, "Kc": 0.25, "Ti": 3}, 104.969, 2.8344),
        ({"T": 3, "Td": 1, "Ti": 3}, 27.3021, 2.7048),
        ({"Kc": 2.5, "Ti": 7}, 31.7312, 2.9659),
        ({"K": 2, "Kc": 0.4, "Ti": 20, "J": 3}, 124.244, 2.5804),
        ({"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 1.5, "Ti": 30}, 62.4696, 2.6305),
        ({"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 1.5, "Ti": 30, "J": 0}, 162.252, 2.9685),
        ({"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 2, "Ti": 15, "J": 0}, 85.0839, 3.2175),
        ({"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 1.5, "Ti": 30, "J": 5}, 26.8850, 2.7540),
    ],
)
def test_exact_cycle_equals_the_golden_simulations(loop, settings, period, amplitude):
    cycle = exact_cycle(sampled_loop(loop(**settings, Ts=0.01)))
    assert cycle.period == pytest.approx(period, rel=3e-3)
    # the golden amplitude is the largest of a tail, which settles slowly where the multiplier is
    # near 1
    assert cycle.amplitude == pytest.approx(amplitude, rel=8e-3)
    assert cycle.multiplier < 1


@pytest.mark.parametrize(
    "settings", [{"J": 0}, {"Ti": None, "Kc": 2}, {"Ti": None, "Kc": 3, "J": 0}, {"S": 0, "J": 0}]
)
def test_loops_that_do_not_cycle_have_no_cycle(loop, settings):
    assert exact_cycle(sampled_loop(loop(**settings, Ts=0.2))) is None


def test_multiplier_predicts_how_fast_a_deviation_dies(loop):
    # integrating PI, J = 0: no jump, hence regular; swings approach the cycle by the multiplier per
    # half cycle
    sampled = sampled_loop(loop("integrating", K=0.1, Td=1, Kc=0.5, Ti=30, J=0, Ts=0.02))
    [half] = half_cycles(sampled)
    x, s, past = on_half_cycle(sampled, half)
    run = reversals(sampled, x, s, past, 200)
    cycle = np.abs(run.stop[-20:]).mean()
    x, s, past = on_half_cycle(sampled, half)
    for part in (x, s[:3], past):
        part *= 1.2
    run = reversals(sampled, x, s, past, 12)
    off = np.abs(np.abs(run.stop) - cycle)
    assert off[5] < 0.2 * cycle
    assert off[-1] < 0.05 * cycle
    assert half.stable


@pytest.mark.parametrize(
    "valve",
    [
        {"model": "kano", "S": 5, "J": 2},
        {"model": "he", "S": 5, "J": 2},
        {"model": "stenman", "d": 3},
        {"model": "coulomb", "S": 5, "J": 2},
        {"model": "stribeck", "S": 5, "J": 2},
    ],
)
@pytest.mark.parametrize(
    "plant", [{}, {"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 1.5, "Ti": 30}]
)
def test_cycles_of_other_valve_models_are_those_of_the_simulator(loop, valve, plant):
    asked = loop(**plant, Ts=0.5, valve=valve)
    sampled = sampled_loop(asked)
    assert sampled.resticks == (valve["model"] != "kano")
    assert sampled.misfit < 0.01
    cycle = exact_cycle(sampled)
    period, amplitude = simulated_cycle(asked, start=cycle_start(asked))
    assert cycle.period == pytest.approx(period, rel=0.015)
    assert cycle.amplitude == pytest.approx(amplitude, rel=0.015)


def test_period_and_amplitude_do_not_change_when_pv_is_scaled(loop):
    one, other = (exact_cycle(sampled_loop(loop(K=K, Kc=1 / K, Ts=0.5))) for K in (1.0, 4.0))
    assert (one.period, one.amplitude) == (other.period, other.amplitude)


def test_amplitude_scales_with_the_valve_and_the_period_does_not(loop):
    one, other = (exact_cycle(sampled_loop(loop(S=2.0 * f, J=1.0 * f, Ts=0.5))) for f in (1, 4))
    assert one.period == other.period
    assert 4 * one.amplitude == pytest.approx(other.amplitude)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"J": 0}, "no limit cycle"),
        ({"effect": [{"name": "gain_mismatch", "factor": 1.1}]}, "no effect"),
    ],
)
def test_cycle_start_explains_why_it_cannot(loop, settings, words):
    with pytest.raises(ParameterError, match=words):
        cycle_start(loop(Ts=0.5, **settings))

"""Truth by name: what `cycled` must say about loops whose story is known."""

import numpy as np
import pytest

from simbench.bench.scenario.truth import (
    MIN_REVERSALS,
    simulate_with_truth,
)
from simbench.loop.motion import motion
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

STICKY = {"model": "choudhury", "S": 5, "J": 2}
IDEAL = {"model": "ideal"}


def loop(valve, *, Kc=1.0, Ti=10.0, noise=0.0, step=5.0, disturbance=(), n=2000, controller="PI"):
    control = {"type": "PI", "Kc": Kc, "Ti": Ti} if controller == "PI" else {"type": "P", "Kc": Kc}
    return Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
            "controller": control,
            "valve": valve,
            "sampling": {"Ts": 1, "n": n},
            "noise": {"std": noise},
            "setpoint": {"value": 50, "steps": [[10, 50 + step]]},
            "disturbance": list(disturbance),
        }
    )


def sine(amplitude, period):
    return {"type": "sine", "amplitude": amplitude, "period": period, "at": "output"}


def answer(chosen, seed=1):
    return simulate_with_truth(chosen, seed)[1].answer


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_limit_cycle_is_yes_with_its_period(noise):
    run, cycled = simulate_with_truth(loop(STICKY, noise=noise), 1)
    assert (run.sticky, cycled.answer) == (True, "yes")
    assert cycled.period == pytest.approx(94.4, rel=0.06)  # exact law for k theta = 0.2
    assert cycled.swing == pytest.approx(2 * 2 / 1.8, rel=0.06)


def test_noise_on_an_ideal_valve_is_no():
    run, cycled = simulate_with_truth(loop(IDEAL, noise=1.0, step=0.0), 1)
    assert (run.sticky, cycled.answer) == (False, "no")


def test_noise_that_leaves_a_sticky_valve_at_rest_is_no():
    assert answer(loop(STICKY, noise=0.2, step=0.0)) == "no"


@pytest.mark.parametrize(
    "valve", [{"model": "deadband", "S": 2}, {"model": "choudhury", "S": 4, "J": 0.2}]
)
def test_a_motion_that_needs_the_noise_is_unclear(valve):
    chosen = loop(
        valve, noise=1.5, step=0.0, controller="P" if valve["model"] == "choudhury" else "PI"
    )
    assert motion(simulate(chosen, 1).record.mv[1000:], 0.1).reversals > 20
    assert answer(chosen) == "unclear"


def test_noise_that_has_started_the_cycle_may_go_off():
    chosen = loop(STICKY, noise=2.5, step=0.0)
    assert np.ptp(simulate(loop(STICKY, step=0.0), 1).record.mv) == 0.0
    assert answer(chosen) == "yes"


def test_a_decaying_transient_is_no():
    # dead-band does not cycle with PI on a self-regulating plant: it swings at first, then rests
    chosen = loop({"model": "deadband", "S": 2}, Kc=3.5, Ti=8.0, step=20.0)
    assert motion(simulate(chosen).record.mv, 0.1).reversals >= 3
    assert answer(chosen) == "no"


def test_a_sine_on_an_ideal_valve_is_no():
    assert answer(loop(IDEAL, disturbance=[sine(3.0, 60.0)])) == "no"


def test_a_sine_below_break_away_leaves_the_valve_frozen_and_is_no():
    chosen = loop(STICKY, controller="P", step=0.0, disturbance=[sine(2.0, 50.0)])
    run, cycled = simulate_with_truth(chosen, 1)
    assert np.ptp(run.record.mv) == 0.0
    assert cycled.answer == "no"


def test_a_sine_above_break_away_is_entrained():
    chosen = loop(STICKY, controller="P", step=0.0, disturbance=[sine(8.0, 50.0)])
    run, cycled = simulate_with_truth(chosen, 1)
    assert motion(run.record.mv, 0.5).reversals > MIN_REVERSALS
    assert cycled.answer == "entrained"


def test_a_stuck_valve_is_no():
    run, cycled = simulate_with_truth(
        loop({"model": "choudhury", "S": 60, "J": 30}, noise=0.1, step=0.0), 1
    )
    assert np.ptp(run.record.mv) == 0.0
    assert (run.sticky, cycled.answer) == (True, "no")


def test_an_aggressive_linear_loop_is_no():
    chosen = loop(IDEAL, Kc=6.5, noise=0.5)
    assert np.ptp(simulate(chosen, 1).record.op[1000:]) > 10
    assert answer(chosen) == "no"


@pytest.mark.parametrize(("valve", "expected"), [(IDEAL, "no"), (STICKY, "unclear")])
def test_a_saturating_loop_is_not_the_valves_doing(valve, expected):
    chosen = loop(valve, Kc=12.0)
    assert np.ptp(simulate(chosen, 1).record.op[1000:]) == 100.0
    assert answer(chosen) == expected


def test_a_dead_zone_is_not_friction():
    run, cycled = simulate_with_truth(loop({"model": "deadzone", "D": 5}, noise=0.3), 1)
    assert (run.sticky, cycled.answer) == (False, "no")


def test_the_record_is_the_one_without_a_tail_bit_for_bit():
    disturbance = [
        {"type": "propagated", "amplitude": 2.0, "period": 70.0, "at": "output"},
        {"type": "random_walk", "amplitude": 1.0, "period": 100.0},
    ]
    chosen = loop(STICKY, noise=0.1, disturbance=disturbance, n=900)
    with_truth, alone = simulate_with_truth(chosen, 7)[0].record, simulate(chosen, 7).record
    for signal in ("op", "pv", "sp", "mv"):
        assert np.array_equal(getattr(with_truth, signal), getattr(alone, signal))


def test_the_answer_does_not_hang_on_the_expected_period():
    chosen = loop(STICKY)
    answers = {
        simulate_with_truth(chosen, 1, period=p)[1].answer for p in (20.0, 50.0, 94.0, 200.0)
    }
    assert answers == {"yes"}

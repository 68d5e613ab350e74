"""Gain change: stiction, a sine from outside, the neighbourhood of the stability limit, and coupled
loops.
"""

import json

import numpy as np
import pytest

from results.studies.coupled_loops import drawn_pair, find_culprit
from simbench.confirm.gain_change import gain_change

IDEAL = {"model": "ideal"}
SINE = [{"type": "sine", "amplitude": 3.0, "period": 60.0}]


@pytest.mark.parametrize(("factor", "J"), [(0.5, 2.0), (0.6, 1.0), (0.6, 5.0), (1.5, 2.0)])
def test_period_of_a_stiction_cycle_follows_the_gain(loop, factor, J):
    outcome = gain_change(loop(J=J), factor)
    assert outcome.verdict == "stiction"
    assert outcome.shift > 0.1
    assert (outcome.after.period > outcome.before.period) == (factor < 1)


@pytest.mark.parametrize(
    ("Kc", "period"), [pytest.param(1.0, 94.4, marks=pytest.mark.slow), (2.0, 44.8)]
)
def test_periods_are_those_of_the_exact_law(loop, Kc, period):
    # the law holds for fast sampling, 0.2 s is 1 % short
    outcome = gain_change(loop(Kc=Kc, Ts=0.2, n=3000), 0.6)
    assert outcome.before.period == pytest.approx(period, rel=0.012)


@pytest.mark.parametrize(("factor", "noise"), [(0.5, 0.0), (0.6, 0.3), (1.5, 0.0)])
def test_period_of_an_external_sine_does_not(loop, noise, factor):
    outcome = gain_change(loop(valve=IDEAL, noise=noise, disturbance=SINE), factor)
    assert outcome.verdict == "no_stiction"
    assert outcome.shift < 0.01
    assert outcome.before.period == pytest.approx(60, rel=0.01)


def test_near_its_stability_limit_a_healthy_loop_moves_its_period_but_is_not_called_sticky(loop):
    # the bare rule, a shift of more than 10 %, would be a false alarm wherever both periods are
    # seen
    healthy = gain_change(loop(valve=IDEAL, Kc=5.2, noise=0.05, n=3000), 0.7, seed=1)
    unstable = gain_change(loop(valve=IDEAL, Kc=6.9, noise=0.05), 0.6)
    assert unstable.shift > 0.1
    assert [healthy.verdict, unstable.verdict] == ["no_stiction", "no_decision"]
    assert "a sound valve stops oscillating" in healthy.reason


def test_a_loop_at_rest_is_nudged_and_that_is_reported(loop):
    assert gain_change(loop()).as_json()["nudge"] > 0
    moved = loop(J=5.0, setpoint={"value": 50, "steps": [[10, 54]]})
    assert gain_change(moved).nudge == 0


def test_same_seed_same_outcome(loop):
    one, other = (gain_change(loop(noise=0.1), seed=7) for _ in range(2))
    assert np.array_equal(one.trace.op, other.trace.op)
    assert one.as_json() == other.as_json()
    assert one.verdict == "stiction"  # noise or not


def test_outcome_is_json_text_and_picture(loop):
    for outcome in (gain_change(loop()), gain_change(loop(J=0.0))):
        answer = json.loads(json.dumps(outcome.as_json()))
        keys = "verdict shift shift_interval nudge before after reason"
        assert set(answer) == set(keys.split())
        keys = "Kc period period_interval amplitude saturated"
        assert set(answer["before"]) == set(keys.split())
        assert outcome.as_text().count("Kc") >= 2
        assert len(outcome.plot().axes) == 2


@pytest.mark.parametrize("sticky", [0, 1])
def test_the_culprit_of_two_coupled_loops_is_named(sticky):
    pair = find_culprit(*drawn_pair(np.random.default_rng(11 + sticky), sticky))
    assert pair.culprit == sticky
    assert pair.shifts[sticky] > 0.1
    # the victim oscillates too, which is why both look sticky
    assert not np.isnan(pair.phases[1 - sticky][0].period)
    assert pair.shifts[1 - sticky] < 0.1
    assert json.loads(json.dumps(pair.as_json()))["culprit"] == sticky
    assert len(pair.plot().axes) == 4

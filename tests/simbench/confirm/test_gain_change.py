"""Gain change: stiction, a sine from outside, the neighbourhood of the stability limit, and coupled
loops.
"""

import json

import numpy as np
import pytest

from results.studies.coupled_loops import drawn_pair, find_culprit, main
from simbench.confirm.gain_change import gain_change
from simbench.detectors.errors import ParameterError

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


@pytest.mark.parametrize(
    "valve", [{"model": "deadband", "S": 5.0}, pytest.param(IDEAL, marks=pytest.mark.slow)]
)
def test_a_loop_that_rests_has_nothing_to_confirm(loop, valve):
    outcome = gain_change(loop(valve=valve, noise=0.01))
    assert outcome.verdict == "no_decision"
    assert "no sustained oscillation" in outcome.reason


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


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"disturbance": SINE}, "outside"),
        pytest.param({}, "no sustained", marks=pytest.mark.slow),
    ],
)
def test_no_culprit_when_the_oscillation_comes_from_outside_or_nothing_oscillates(
    loop, more, reason
):
    pair = [loop(valve=IDEAL, **more), loop(valve=IDEAL, Kc=0.5)]
    outcome = find_culprit(pair, np.array([[0, 0.3], [0.3, 0]]))
    assert outcome.culprit is None
    assert reason in outcome.reason


@pytest.mark.parametrize("pairs", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_culprit_is_named_in_random_pairs(monkeypatch, capsys, pairs):
    monkeypatch.setattr("sys.argv", ["coupled", "--pairs", str(pairs), "--seed", "12"])
    main()
    assert f"culprit named in {pairs} of {pairs} pairs" in capsys.readouterr().out


def test_one_loop_is_no_pair(loop):
    with pytest.raises(ParameterError, match="two or more"):
        find_culprit([loop()], np.zeros((1, 1)))


def test_a_rule_on_the_period_alone_would_call_a_level_that_rolls_sticky(loop):
    slow = {"plant": {"type": "integrating", "K": 0.0033, "Td": 5.0}}
    slow |= {"controller": {"type": "PI", "Kc": 0.35, "Ti": 60.0}}
    load = [{"type": "coloured", "amplitude": 1.0, "period": 400.0}]
    rolls = loop(valve=IDEAL, noise=0.1, Ts=5.0, n=4000, disturbance=load, **slow)
    outcomes = [gain_change(rolls, 0.6, seed) for seed in range(3)]
    assert any(outcome.shift > 0.1 for outcome in outcomes)
    assert all(outcome.verdict != "stiction" for outcome in outcomes)


def test_friction_that_is_stated_as_an_effect_is_not_in_the_sound_loop(loop):
    as_effect = loop(valve=IDEAL, effect=[{"name": "stiction", "S": 5.0, "J": 2.0}])
    assert gain_change(as_effect).verdict == gain_change(loop()).verdict == "stiction"

"""Gain change: stiction, a sine from outside, the neighbourhood of the stability limit, and coupled
loops.
"""

import json

import numpy as np
import pytest

from detectors.errors import ParameterError
from results.studies.coupled_loops import drawn_pair, find_culprit, main
from simbench.confirm.gain_change import SHIFT, gain_change, judge, measure

SINE = [{"type": "sine", "amplitude": 3.0, "period": 60.0}]


@pytest.mark.parametrize("factor", [0.5, 0.6, 1.5])
@pytest.mark.parametrize("J", [1.0, 2.0, 5.0])
def test_period_of_a_stiction_cycle_follows_the_gain(loop, factor, J):
    found = gain_change(loop(J=J), factor)
    assert found.verdict == "stiction"
    assert found.shift > 0.1
    assert (found.after.period > found.before.period) == (factor < 1)


def test_periods_are_those_of_the_exact_law(loop):
    for Kc, period in ((1.0, 94.4), (2.0, 44.8)):
        # the law holds for fast sampling, 0.2 s is 1 % short
        found = gain_change(loop(Kc=Kc, Ts=0.2, n=6000), 0.6)
        assert found.before.period == pytest.approx(period, rel=0.012)


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("factor", [0.5, 0.6, 1.5])
def test_period_of_an_external_sine_does_not(loop, noise, factor):
    found = gain_change(loop(valve={"model": "ideal"}, noise=noise, disturbance=SINE), factor)
    assert found.verdict == "no_stiction"
    assert found.shift < 0.01
    assert found.before.period == pytest.approx(60, rel=0.01)


def test_a_sticky_loop_with_noise_is_still_confirmed(loop):
    assert gain_change(loop(noise=0.05), seed=4).verdict == "stiction"


def test_near_its_stability_limit_a_healthy_loop_moves_its_period_but_is_not_called_sticky(loop):
    healthy = loop(valve={"model": "ideal"}, Kc=5.2, noise=0.05, n=3000)
    found = gain_change(healthy, 0.7, seed=1)
    # the bare rule, a shift of more than 10 %, would be a false alarm wherever both periods are
    # seen
    assert found.verdict == "no_decision"
    unstable = gain_change(loop(valve={"model": "ideal"}, Kc=6.9, noise=0.05), 0.6)
    assert unstable.shift > SHIFT
    assert unstable.verdict == "no_decision"


@pytest.mark.parametrize("valve", [{"model": "ideal"}, {"model": "deadband", "S": 5.0}])
def test_a_loop_that_rests_has_nothing_to_confirm(loop, valve):
    found = gain_change(loop(valve=valve, noise=0.01))
    assert found.verdict == "no_decision"
    assert "no sustained oscillation" in found.reason


def test_a_loop_at_rest_is_nudged_and_that_is_said(loop):
    assert gain_change(loop()).as_json()["nudge"] > 0
    moved = loop(J=5.0, setpoint={"value": 50, "steps": [[10, 54]]})
    assert gain_change(moved).nudge == 0


def test_judgement_of_two_phases():
    wave = np.sin(np.arange(1000) / 5)
    slow = np.sin(np.arange(1000) / 8)
    assert judge(measure(wave, 1, 1), measure(slow, 1, 0.5))[0] == "stiction"
    assert judge(measure(wave, 1, 1), measure(wave, 1, 0.5))[0] == "no_stiction"
    assert judge(measure(wave, 1, 1), measure(0.1 * slow, 1, 0.5))[0] == "no_decision"
    assert judge(measure(wave, 1, 1), measure(np.zeros(1000), 1, 0.5))[0] == "no_decision"
    assert judge(measure(np.clip(wave, -0.8, 0.8), 1, 1), measure(slow, 1, 0.5))[0] == "no_decision"


def test_same_seed_same_outcome(loop):
    one, other = (gain_change(loop(noise=0.1), seed=7) for _ in range(2))
    assert np.array_equal(one.trace.op, other.trace.op)
    assert one.as_json() == other.as_json()


def test_outcome_is_json_text_and_picture(loop):
    for found in (gain_change(loop()), gain_change(loop(J=0.0))):
        answer = json.loads(json.dumps(found.as_json()))
        assert set(answer) == {
            "verdict",
            "shift",
            "shift_interval",
            "nudge",
            "before",
            "after",
            "reason",
        }
        assert set(answer["before"]) == {
            "Kc",
            "period",
            "period_interval",
            "amplitude",
            "saturated",
        }
        assert found.as_text().count("Kc") >= 2
        assert len(found.plot().axes) == 2


@pytest.mark.parametrize("factor", [1.0, 0.9, 0.1, -0.5, float("nan")])
def test_a_gain_change_too_small_or_too_large_is_refused(loop, factor):
    with pytest.raises(ParameterError, match="factor"):
        gain_change(loop(), factor)


@pytest.mark.parametrize("sticky", [0, 1])
def test_the_culprit_of_two_coupled_loops_is_named(sticky):
    found = find_culprit(*drawn_pair(np.random.default_rng(11 + sticky), sticky))
    assert found.culprit == sticky
    assert found.shifts[sticky] > 0.1
    # the victim oscillates too, which is why both look sticky
    assert not np.isnan(found.phases[1 - sticky][0].period)
    assert found.shifts[1 - sticky] < 0.1
    assert json.loads(json.dumps(found.as_json()))["culprit"] == sticky
    assert len(found.plot().axes) == 4


def test_no_culprit_when_the_oscillation_comes_from_outside(loop):
    pair = [
        loop(valve={"model": "ideal"}, disturbance=SINE),
        loop(valve={"model": "ideal"}, Kc=0.5),
    ]
    found = find_culprit(pair, np.array([[0, 0.3], [0.3, 0]]))
    assert found.culprit is None
    assert "outside" in found.reason


def test_no_culprit_when_nothing_oscillates(loop):
    found = find_culprit([loop(valve={"model": "ideal"})] * 2, np.array([[0, 0.3], [0.3, 0]]))
    assert found.culprit is None
    assert "no sustained" in found.reason


def test_culprit_is_named_in_random_pairs(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["coupled", "--pairs", "4", "--seed", "12"])
    main()
    assert "culprit named in 4 of 4 pairs" in capsys.readouterr().out


def test_one_loop_is_no_pair(loop):
    with pytest.raises(ParameterError, match="two or more"):
        find_culprit([loop()], np.zeros((1, 1)))

"""The confirmation tests read off records agree with those on the loop that made the records."""

import numpy as np
import pytest

from simbench.confirm.gain_change import gain_change
from simbench.confirm.recorded import controller_gain, gain_change_recorded, travel_recorded
from simbench.confirm.travel import travel_test
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.loop.response import valve_response

T = np.arange(3000.0)


def wave(period: float, amplitude: float = 1.0) -> LoopRecord:
    angle = 2 * np.pi * T / period
    return LoopRecord(50 + amplitude * np.sin(angle), np.cos(angle), 1.0)


@pytest.mark.parametrize(
    ("after", "verdict"),
    [(wave(150.7), "stiction"), (wave(92.3), "no_stiction"), (wave(150.7, 5), "no_decision")],
)
def test_the_period_decides_and_the_amplitude_may_object(after, verdict):
    assert gain_change_recorded(wave(90.3), after, 0.6).verdict == verdict


def test_a_crest_met_at_the_same_value_in_every_cycle_is_no_limit_but_a_clipped_one_is():
    assert gain_change_recorded(wave(90), wave(150), 0.6).verdict == "stiction"
    clipped = LoopRecord(np.minimum(wave(90).op, 50.8), wave(90).pv, 1.0)
    assert "limits" in gain_change_recorded(clipped, wave(150), 0.6).reason


def test_records_of_a_gain_change_give_its_verdict_and_show_the_gain(loop):
    live = gain_change(loop())
    cuts = slice(live.changed // 3, live.changed), slice(live.changed + 500, None)
    op, pv, sp = live.trace.op, live.trace.pv, np.full(live.trace.pv.size, 50.0)
    records = [LoopRecord(op[c], pv[c], live.Ts, sp=sp[c]) for c in cuts]
    outcome = gain_change_recorded(*records, factor=0.6)
    assert outcome.verdict == live.verdict == "stiction"
    assert outcome.shift == pytest.approx(live.shift, abs=0.1)
    assert controller_gain(records[0]) == pytest.approx(1.0, rel=0.05)
    assert controller_gain(records[1]) == pytest.approx(0.6, rel=0.05)
    assert gain_change_recorded(*records).verdict == "stiction"
    assert outcome.plot().axes


NOISE = LoopRecord(*np.random.default_rng(0).random((2, 900)), 1.0)


@pytest.mark.parametrize(
    ("after", "factor", "words"),
    [
        (LoopRecord(np.ones(99), np.ones(99), 2.0), 0.6, "Ts = 1 s before and 2 s after"),
        (wave(150.7), 1.1, "at least 20 %"),
        (NOISE, None, "--ratio"),
    ],
)
def test_what_cannot_be_judged_is_one_sentence(after, factor, words):
    with pytest.raises(ParameterError, match=words):
        gain_change_recorded(wave(90.3), after, factor=factor)


def read_again(live, process="self-regulating"):
    return travel_recorded(LoopRecord(live.trace.op, live.trace.pv, live.Ts, process=process))


@pytest.mark.parametrize(
    ("settings", "process"),
    [
        ({}, "self-regulating"),
        ({"S": 3.1, "J": 1.1, "noise": 0.02}, "self-regulating"),
        ({"S": 1.3, "J": 1.1}, "self-regulating"),
        ({"kind": "integrating", "K": 0.05}, "integrating"),
    ],
)
def test_a_recorded_travel_test_measures_what_the_live_one_did(loop, settings, process):
    live = travel_test(loop(**settings))
    test = read_again(live, process)
    assert (test.J, test.S) == pytest.approx((live.J, live.S), abs=0.2 + 1e-9)
    assert test.sticky
    assert test.increment == pytest.approx(0.2)


def test_a_valve_without_friction_follows(loop):
    assert read_again(travel_test(loop(S=0.0, J=0.0))).sticky is False


def test_the_band_counts_from_the_valves_last_move_however_op_wandered_before_it_turned():
    """Four more steps up that the valve did not follow are no part of S."""
    ends = [50.0, 58.0, *(58 + 0.2 * np.arange(1, 16)), *(61 - 0.2 * np.arange(1, 41))]
    op = np.repeat(ends, 40)
    valve = valve_response("choudhury", op, {"S": 5.0, "J": 2.0})
    pv = valve + 0.001 * np.sin(np.arange(op.size))
    test = travel_recorded(LoopRecord(op, pv, 1.0, process="self-regulating"))
    assert (test.J, test.S) == pytest.approx((2.1, 5.1), abs=0.11)
    answer = test.as_json()
    assert answer["verdict"] == "stiction"
    assert answer["S_interval"][0] <= 5.0 <= answer["S_interval"][1]
    assert answer["J_interval"][0] <= 2.0 + 1e-9 <= answer["J_interval"][1]


def test_the_period_and_its_shift_carry_intervals_that_hold_the_truth():
    """Cycles of 90 s and 150 s on the average, each of its own length: the interval of the mean is
    that of the draw.
    """
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(40):
        waves = []
        for P in (90.0, 150.0):
            lengths = P * (1 + 0.06 * rng.standard_normal(30))
            phase = np.interp(
                np.arange(lengths.sum()), np.concatenate([[0], np.cumsum(lengths)]), np.arange(31.0)
            )
            waves.append(LoopRecord(50 + np.sin(2 * np.pi * phase), np.cos(2 * np.pi * phase), 1.0))
        answer = gain_change_recorded(*waves, 0.6).as_json()
        lo, hi = answer["shift_interval"]
        covered += lo <= 150 / 90 - 1 <= hi
        lo, hi = answer["before"]["period_interval"]
        assert lo < answer["before"]["period"] < hi
    assert covered >= 34, covered  # 95 % of 40, and three times the luck


def test_a_record_in_automatic_mode_holds_no_travel_test():
    with pytest.raises(ParameterError, match="OP rests"):
        travel_recorded(wave(90.3))

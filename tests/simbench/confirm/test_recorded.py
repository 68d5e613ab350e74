"""The travel test read off a record agrees with that on the loop that made the record."""

import numpy as np
import pytest
from scipy.signal import lfilter

from simbench.confirm.recorded import travel_recorded
from simbench.confirm.travel import travel_test
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.loop.response import valve_response

T = np.arange(3000.0)


def wave(period: float, amplitude: float = 1.0) -> LoopRecord:
    angle = 2 * np.pi * T / period
    return LoopRecord(50 + amplitude * np.sin(angle), np.cos(angle), 1.0)


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


def test_a_record_in_automatic_mode_holds_no_travel_test():
    with pytest.raises(ParameterError, match="OP rests"):
        travel_recorded(wave(90.3))


@pytest.mark.parametrize(("T", "noise"), [(3.0, 0.4), (20.0, 0.2), (60.0, 0.05), (60.0, 0.4)])
def test_noise_and_short_holds_make_no_valve_stick(T, noise):
    ends = [50.0, 58.0, *(58 + 0.2 * np.arange(1, 16)), *(61 - 0.2 * np.arange(1, 41))]
    op, follow = np.repeat(ends, 40), 1.0 - np.exp(-1.0 / T)
    quiet = 50.0 + lfilter([0.0, follow], [1.0, follow - 1.0], op - 50.0)
    verdicts = set()
    for seed in range(8):
        pv = quiet + noise * np.random.default_rng(seed).standard_normal(op.size)
        test = travel_recorded(LoopRecord(op, pv, 1.0, process="self-regulating"))
        verdicts.add(test.as_json()["verdict"])
        if test.sticky is None:
            assert "larger steps, or longer holds" in test.reason
    assert "stiction" not in verdicts

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


def test_pulses_on_one_level_are_no_travel_test():
    op = np.tile(np.append(np.full(40, 50.0), np.full(3, 51.0)), 8)
    with pytest.raises(ParameterError, match="OP rests at 50 % alone"):
        travel_recorded(LoopRecord(op, np.cos(np.arange(op.size)), 1.0))


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


def staircase(protocol, base=50.0):
    """Return OP at each hold of a protocol that plants use."""
    if protocol == "ISA-75.25":
        return np.concatenate(
            [[base], *([base + s, base, base - s, base] for s in (0.25, 0.5, 1, 2, 5, 10))]
        )
    if protocol == "ladder of 1 %":
        return base + np.concatenate([np.arange(11), np.arange(9, -11, -1), np.arange(-9, 1)])
    if protocol == "Gerry and Ruel":
        up = base + 10 + 0.2 * np.arange(1, 26)
        return np.concatenate([[base, base + 10], up, up[-1] - 0.2 * np.arange(1, 51)])
    rng = np.random.default_rng(3)
    steps = rng.choice([-1.0, 1.0], 40) * rng.choice([0.3, 0.7, 1.5, 3.0, 6.0], 40)
    return np.clip(base + np.cumsum(np.append(0.0, steps)), 10.0, 90.0)


def by_hand(levels, S, J, seed, model="choudhury", mv=False, hold=60):
    op = np.repeat(levels, hold)
    valve = op if S == 0.0 else valve_response(model, op, {"S": S, "J": J})
    follow, noise = 1.0 - np.exp(-1.0 / 8.0), np.random.default_rng(seed).standard_normal(op.size)
    pv = 20.0 - 1.4 * lfilter([follow], [1.0, follow - 1.0], valve - op[0]) + 0.04 * noise
    recorded = valve if mv else None
    return LoopRecord(op, pv, 1.0, mv=recorded, process="self-regulating")


PROTOCOLS = ["ISA-75.25", "ladder of 1 %", "Gerry and Ruel", "steps of any size"]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_any_staircase_tells_S_and_J_within_their_intervals(protocol):
    rng, inside, told = np.random.default_rng(11), 0, []
    for seed in range(10):
        S = float(rng.uniform(1.2, 4.0))
        J = S * float(rng.uniform(0.1, 1.0))
        model = ("choudhury", "kano")[seed % 2]
        test = travel_recorded(by_hand(staircase(protocol), S, J, seed, model))
        ends = test.S_interval, test.J_interval
        inside += all(lo <= x <= hi for (lo, hi), x in zip(ends, (S, J), strict=True))
        told.append(test.verdict)
        assert "did not move" not in test.reason
    assert inside >= 9
    assert "no_stiction" not in told
    assert told.count("stiction") >= 7


def test_the_band_lies_between_the_last_step_without_movement_and_the_first_with_it():
    test = travel_recorded(by_hand(staircase("ISA-75.25"), 1.1, 1.1, 0))
    assert test.S_interval == pytest.approx((1.0, 2.0), rel=0.06)
    assert test.J_interval == pytest.approx((1.0, 2.0), rel=0.06), "it lost no motion"


def test_mv_tells_more_closely_unless_pv_contradicts_it():
    levels = staircase("steps of any size")
    alone, both = (travel_recorded(by_hand(levels, 2.0, 0.5, 1, mv=mv)) for mv in (False, True))
    width = [hi - lo for lo, hi in (alone.J_interval, both.J_interval)]
    assert both.J_interval[0] <= 0.5 <= both.J_interval[1]
    assert width[1] < width[0]
    record = by_hand(levels, 2.0, 0.5, 1)
    echo = travel_recorded(LoopRecord(record.op, record.pv, 1.0, mv=record.op))
    assert echo.S_interval == alone.S_interval, "the feedback says that the valve follows"


def test_a_valve_that_stands_is_the_only_one_that_did_not_move():
    op = np.repeat(staircase("ladder of 1 %"), 60)
    pv = 20.0 + 0.04 * np.random.default_rng(0).standard_normal(op.size)
    test = travel_recorded(LoopRecord(op, pv, 1.0, process="self-regulating"))
    assert (test.verdict, test.S, test.S_interval) == ("no_decision", None, None)
    assert "PV did not move on any step" in test.reason


def test_large_steps_that_a_valve_follows_leave_small_friction_open():
    levels = 50.0 + 3.0 * np.concatenate([np.arange(5), np.arange(3, -4, -1)])
    test = travel_recorded(by_hand(levels, 0.0, 0.0, 0))
    assert test.verdict == "no_decision"
    assert "smaller steps tell more" in test.reason

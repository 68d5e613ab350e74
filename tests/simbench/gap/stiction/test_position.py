"""MV is evidence, not a verdict: what does not explain PV is not the position of the valve."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap import diagnose
from simbench.gap.stiction.conclusion import judged
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

S, J = 5.0, 2.0
LOOP = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 0.8, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "disturbance": [{"type": "coloured", "amplitude": 1.5, "period": 60.0}],
    "setpoint": {"value": 50.0, "steps": [[300, 53], [900, 49]]},
    "operating_point": {"op0": 50.0, "pv0": 50.0},
}


def recorded(sticks: bool) -> LoopRecord:
    """A loop with its MV and the noise of a position transmitter."""
    valve = {"model": "choudhury", "S": S, "J": J} if sticks else {"model": "ideal"}
    record = simulate(Loop.from_table(LOOP | {"valve": valve}), 5).record
    return with_mv(record, record.mv + 0.05 * np.random.default_rng(1).normal(size=record.n))


def with_mv(record: LoopRecord, mv: np.ndarray) -> LoopRecord:
    return LoopRecord(record.op, record.pv, record.Ts, record.sp, np.round(mv, 2))


STICKY, SOUND = recorded(True), recorded(False)
SCALES = {"reversed": (-1.0, 100.0), "mm of stroke": (0.25, 0.0), "calibration": (0.9, 3.0)}


@pytest.mark.parametrize(("gain", "offset"), SCALES.values(), ids=SCALES)
def test_a_sticking_valve_is_found_whatever_the_scale_of_mv(gain, offset):
    found = judged(with_mv(STICKY, offset + gain * STICKY.mv))[0]
    assert found.verdict == "stiction"
    assert found.S.value == pytest.approx(S, rel=0.1)
    assert "MV is not written in the unit of OP" in found.reason


@pytest.mark.parametrize(("gain", "offset"), SCALES.values(), ids=SCALES)
def test_a_sound_valve_is_sound_whatever_the_scale_of_mv(gain, offset):
    assert judged(with_mv(SOUND, offset + gain * SOUND.mv))[0].verdict != "stiction"


@pytest.mark.parametrize("late", [0, 2])
def test_an_echo_of_op_denies_nothing_where_op_and_pv_show_friction(late):
    echo = np.append(np.repeat(STICKY.op[0], late), STICKY.op[: STICKY.n - late])
    found = judged(with_mv(STICKY, echo))[0]
    assert found.verdict != "no_stiction"
    assert "MV repeats OP" in found.reason
    assert found.probability > 0.5


def test_a_feedback_ahead_of_the_fault_denies_nothing():
    feedback = STICKY.op + 0.1 * np.random.default_rng(2).normal(size=STICKY.n)
    found = judged(with_mv(STICKY, feedback))[0]
    assert found.verdict != "no_stiction"
    assert "MV is not the position" in found.reason


def test_a_true_position_is_believed():
    assert judged(STICKY)[0].verdict == "stiction"
    sound = judged(SOUND)[0]
    assert sound.verdict == "no_stiction"
    assert "MV" not in sound.reason


def test_a_frozen_transmitter_is_no_seized_valve():
    frozen = 50.0 + 0.05 * np.random.default_rng(3).normal(size=SOUND.n)
    found = judged(with_mv(SOUND, frozen))[0]
    assert found.verdict != "stiction"
    assert "its transmitter is frozen" in found.reason


@pytest.fixture(scope="module", params=["all along", "late", "exactly"])
def seized(request):
    """A loop whose valve stands at 50 %, from the beginning or from sample 500 on."""
    rng = np.random.default_rng(4)
    n, first = 1800, 500 if request.param == "late" else 0
    op, pv, mv = np.full(n, 50.0), np.full(n, 50.0), np.full(n, 50.0)
    load = slow = integral = 0.0
    for k in range(1, n):
        load = 0.97 * load + 0.3 * rng.normal()
        error = 50.0 - pv[k - 1]
        integral = np.clip(integral + 0.6 / 20.0 * error, -35.0, 35.0)
        op[k] = 50.0 + 0.6 * error + integral
        mv[k] = op[k] if k < first else mv[k - 1]
        slow += (1.2 * (mv[k] - 50.0) + load - slow) / 15.0
        pv[k] = 50.0 + 2.0 * slow + 0.05 * rng.normal()
    noise = 0.0 if request.param == "exactly" else 0.05
    return LoopRecord(op, pv, 1.0, np.full(n, 50.0), np.round(mv + noise * rng.normal(size=n), 1))


def test_a_valve_that_does_not_move_has_a_cause_of_its_own(seized):
    found, causes = judged(seized)
    assert (found.verdict, found.cause) == ("stiction", "the valve does not move")
    assert "air supply" in found.next
    assert causes.named.block == "valve"


def test_detect_and_gap_say_the_same_of_it(seized):
    report = diagnose(seized, Loop.from_table(LOOP | {"sampling": {"Ts": 1.0, "n": 1800}}))
    assert report.conclusion.cause == "the valve does not move"


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_where_pv_does_not_tell_whether_the_valve_or_its_transmitter_stands_nothing_is_claimed(
    seed,
):
    # a sound valve that makes up for a slow load, so that PV hardly moves
    rng = np.random.default_rng([seed, 18])
    T = float(rng.uniform(10.0, 50.0))
    loop = {
        "plant": {"type": "foptd", "K": 1.0, "T": T, "Td": 0.3 * T},
        "controller": {"type": "PI", "Kc": 1.2, "Ti": T},
        "valve": {"model": "ideal"},
        "sampling": {"Ts": round(T / 12, 1), "n": 1500},
        "noise": {"std": 0.1},
        "disturbance": [{"type": "coloured", "amplitude": 2.0, "period": 6.0 * T}],
    }
    record = simulate(Loop.from_table(loop), seed).record
    found = judged(with_mv(record, 50.0 + 0.05 * rng.normal(size=record.n)))[0]
    assert found.verdict == "no_decision"
    assert "transmitter is frozen" in found.reason


@pytest.mark.parametrize("n", [50, 300])
def test_what_cannot_be_weighed_is_not_called_seized(n):
    """Too short a record, or OP moved by hand with PV behind it, tells nothing about MV."""
    t = np.arange(n)
    op = 50.0 + 5.0 * np.sin(t / 5.0) if n == 50 else 50.0 + 5.0 * (t > 100)
    record = LoopRecord(op, 50.0 + 0.9 * (op - 50.0), 1.0, mv=np.full(n, 50.0))
    assert judged(record)[0].verdict != "stiction"


def test_the_diagnosis_with_a_loop_file_does_not_believe_an_echo():
    echo = with_mv(STICKY, STICKY.op)
    with_echo, alone = (diagnose(r, Loop.from_table(LOOP)) for r in (echo, echo.without_mv()))
    assert (with_echo.effect, with_echo.block) == (alone.effect, alone.block)
    assert any("MV repeats OP" in note for note in with_echo.notes)

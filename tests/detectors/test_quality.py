"""Data-quality flags: each fires on its fault, and none on a healthy or a noise-free sticky
loop.
"""

import numpy as np
import pytest
from plain_loops import DELAYED, LEVEL

from simbench.detectors.judge import UNFIT, judge
from simbench.detectors.prepared import prepare
from simbench.detectors.quality import inspect, saturation, steps
from simbench.detectors.record import LoopRecord

T = np.arange(2000.0)


def noisy(seed=0, **changes):
    rng = np.random.default_rng(seed)
    signals = {
        "op": 50 + 5 * np.sin(T / 8) + 0.3 * rng.standard_normal(2000),
        "pv": 20 + np.cos(T / 8) + 0.1 * rng.standard_normal(2000),
    }
    return LoopRecord(**{**signals, "Ts": 1.0, **changes})


def swinging_door(x, width):
    """Keep a sample when no straight line from the last kept one runs within the width of all
    since; lines between.
    """
    kept, low, high = [0], -np.inf, np.inf
    for k in range(1, x.size):
        start = kept[-1]
        low = max(low, (x[k] - width - x[start]) / (k - start))
        high = min(high, (x[k] + width - x[start]) / (k - start))
        if low > high:
            kept.append(k - 1)
            low, high = x[k] - width - x[k - 1], x[k] + width - x[k - 1]
    kept.append(x.size - 1)
    return np.interp(np.arange(x.size), kept, x[kept])


def faults():
    record = noisy()
    op, pv = record.op, record.pv
    frozen = pv.copy()
    frozen[700:900] = frozen[700]
    spiky = pv.copy()
    spiky[100::200] += 8.0
    return {
        "dead_op": noisy(op=np.full(2000, 37.0)),
        "dead_pv": noisy(pv=np.full(2000, 37.0)),
        "manual": noisy(op=np.where(T < 900, 40.0, 45.0)),
        "saturated": noisy(op=np.clip(op, 46.5, 60.0)),
        "quantised_op": noisy(op=np.round(op)),
        "quantised_pv": noisy(pv=np.round(pv * 4) / 4),
        "compressed": noisy(pv=swinging_door(pv, 0.15)),
        "held": noisy(op=np.repeat(op[::5], 5), pv=np.repeat(pv[::5], 5)),
        "frozen": noisy(pv=frozen),
        "undersampled": noisy(op=np.sin(T * 2.0), pv=np.cos(T * 2.0)),
        "moving_sp": noisy(sp=np.where(T < 900, 20.0, 22.0)),
        "off_setpoint": noisy(sp=np.full(2000, 40.0)),
        "spikes": noisy(pv=spiky),
        "gaps": noisy(notes=("gaps: 3 of 2000 samples missing, bridged by straight lines",)),
    }


@pytest.mark.parametrize("name", sorted(faults()))
def test_each_fault_raises_its_flag_with_its_number(name):
    flags = inspect(faults()[name])
    assert name in flags, sorted(flags)
    assert len(flags[name].evidence) > 10


def test_sound_record_raises_no_flag():
    assert inspect(noisy()) == {}
    assert inspect(noisy(sp=np.full(2000, 20.0))) == {}


LOOPS = {
    "self-regulating": DELAYED,
    "flow": {"T": 0.5, "Td": 1.0, "Kc": 0.3, "Ti": 3.0},
    "integrating": {
        **LEVEL,
        "kick": 6.0,
    },
    "dead-band": {**LEVEL, "J": 0.0},
}


@pytest.mark.parametrize("kind", sorted(LOOPS))
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("rounded", [False, True])
def test_sticky_loop_is_fit_to_be_judged(loop, kind, noise, rounded):
    record = loop(**LOOPS[kind], noise=noise, n=2500)
    if rounded:
        op, pv = (np.array([float(f"{v:.6g}") for v in x]) for x in (record.op, record.pv))
        record = LoopRecord(op=op, pv=pv, Ts=1.0)
    flags = inspect(record)
    assert not set(UNFIT) & set(flags), flags
    assert not {"compressed", "quantised_op", "quantised_pv"} & set(flags), flags


@pytest.mark.parametrize("rounded", [False, True])
def test_healthy_loop_under_load_steps_is_fit_to_be_judged(loop, rounded):
    load = np.where(T < 400, 0.0, np.where(T < 1100, 3.0, -2.0))
    record = loop(S=0.0, J=0.0, load=load, n=2000)
    if rounded:
        op, pv = (np.array([float(f"{v:.6g}") for v in x]) for x in (record.op, record.pv))
        record = LoopRecord(op=op, pv=pv, Ts=1.0)
    assert not (set(UNFIT) | {"compressed", "frozen"}) & set(inspect(record))


def test_saturation_at_the_ends_of_the_span_is_seen_through_noise():
    rng = np.random.default_rng(0)
    op = np.clip(80 + 40 * np.sin(T / 8) + rng.standard_normal(2000), 0, 100)
    share, limit = saturation(op, np.cos(T / 8), op)
    assert share == pytest.approx((op == 100).mean())
    assert limit == 100.0


def test_one_short_stay_at_the_lowest_value_is_no_limit():
    op = np.concatenate([np.full(70, 5.0), 5.0 + np.cumsum(np.random.default_rng(0).random(700))])
    assert saturation(op, np.random.default_rng(1).random(770))[0] == 0.0


def test_two_or_three_positions_are_no_quantisation():
    op = np.where(T % 200 > 100, 20.0, 60.0) + 20.0 * (T % 400 > 300)
    assert np.unique(op).size == 3
    assert "quantised_op" not in inspect(noisy(op=op))
    assert "quantised_op" in inspect(noisy(op=op + 20.0 * (T % 800 > 600)))


def test_crest_of_a_coarse_triangle_is_no_limit():
    op = np.round(10 * np.arcsin(np.sin(T / 16)))
    assert saturation(op, np.cos(T / 16))[0] == 0.0


def test_rounding_of_a_file_is_no_quantisation(loop):
    record = loop(noise=0.05, **DELAYED)
    pv = np.round(record.pv, 3)
    assert steps(pv, pv) == pytest.approx(0.001)
    assert "quantised_pv" not in inspect(LoopRecord(record.op, pv, 1.0))


@pytest.mark.parametrize("flag", ["dead_op", "dead_pv", "manual", "saturated"])
def test_every_method_abstains_on_an_unfit_record_and_gives_its_reason(flag):
    for verdict in judge(faults()[flag], ["horch", "he", "yamashita"]):
        assert verdict.verdict == "no_decision"
        assert flag in verdict.reason


def test_gaps_tell_how_many_periods_of_the_loop_are_left():
    flag = prepare(noisy(notes=("gaps: 3 of 2000 samples missing",))).flags["gaps"]
    assert flag.evidence.endswith("; 40 periods of the loop are left")  # 2000 s / (16 pi s)

"""Kano 2004, methods A and B: standstill and parallelogram."""

import numpy as np
import pytest
from plain_loops import DELAYED

from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.standstill import stuck_intervals


def naive_intervals(op, still, period, least_op):
    intervals, k = [], 0
    while k < op.size:
        if not still[k]:
            k += 1
            continue
        end = k
        while end < op.size and still[end]:
            end += 1
        moved = op[k:end].max() - op[k:end].min()
        if end - k >= 0.05 * period and moved >= least_op:
            intervals.append((end - k, moved))
        k = end
    return intervals


def test_intervals_equal_those_computed_sample_by_sample():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        op, still = np.cumsum(rng.standard_normal(200)), rng.random(200) < 0.8
        length, moved = stuck_intervals(op, still, 60.0, 1.0)
        assert list(zip(length.tolist(), moved.tolist(), strict=True)) == naive_intervals(
            op, still, 60.0, 1.0
        )


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize(("S", "J"), [(5.0, 0.5), (5.0, 2.0), (8.0, 2.0)])
def test_parallelogram_is_as_wide_as_S_less_J(loop, S, J, noise):
    record = loop(S=S, J=J, **DELAYED, Ts=0.5, n=6000, noise=noise, kick=1.2 * S)
    a, b = judge(record, ["kano_a", "kano_b"])
    assert (a.verdict, b.verdict) == ("stiction", "stiction")
    assert b.S == pytest.approx(S - J, abs=0.5)
    assert a.S == pytest.approx(S, rel=0.25)


def test_widths_are_given_in_percent_of_the_span(loop):
    record = loop(**DELAYED, Ts=0.5, n=6000)
    other = LoopRecord(
        4.0 + 0.16 * record.op,
        record.pv,
        0.5,
        mv=record.mv,
        process="self-regulating",
        op_span=(4.0, 20.0),
    )
    for one, two in zip(
        judge(record, ["kano_a", "kano_b"]), judge(other, ["kano_a", "kano_b"]), strict=True
    ):
        assert one.S == pytest.approx(two.S, rel=1e-6)
        assert two.S_unit == "% of travel"


@pytest.mark.parametrize("lag", [0.0, 0.3, 0.8])
def test_lag_alone_is_no_stiction(lag):
    t = np.arange(3000) / 20
    record = LoopRecord(
        50 + np.sin(t), 50 + np.sin(t - lag), 0.05, kind="flow", process="self-regulating"
    )
    for verdict in judge(record, ["kano_a", "kano_b"]):
        assert verdict.verdict == "no_stiction", verdict


def test_jump_as_wide_as_the_band_leaves_no_parallelogram(loop):
    record = loop(S=5.0, J=5.0, **DELAYED, Ts=0.5, n=6000, kick=6.0)
    a, b = judge(record, ["kano_a", "kano_b"])
    assert a.verdict == "stiction"
    assert b.verdict == "no_decision"
    assert b.S is None

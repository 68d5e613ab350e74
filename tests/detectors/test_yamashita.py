"""Yamashita 2006: movements of OP and valve as symbols."""

import numpy as np
import pytest
from naive import yamashita_indices
from plain_loops import DELAYED, LEVEL
from scipy.stats import norm

from simbench.detectors.judge import judge
from simbench.detectors.methods.yamashita import movement_indices
from simbench.detectors.record import LoopRecord


@pytest.mark.parametrize("step", [1, 3])
def test_indices_equal_those_counted_pair_by_pair(step):
    for seed in range(10):
        op, mv = np.cumsum(np.random.default_rng(seed).standard_normal((2, 300)), axis=1)
        assert movement_indices(op, mv, step) == pytest.approx(
            yamashita_indices(op, mv, step), abs=1e-12
        )


def test_two_independent_noises_have_a_large_rho1_and_a_small_rho3():
    op, mv = np.cumsum(np.random.default_rng(1).standard_normal((2, 200_000)), axis=1)
    p, s = norm.sf(1.0), 1 - 2 * norm.sf(1.0)
    rho1, _, rho3 = movement_indices(op, mv)
    assert rho1 == pytest.approx(2 * p * s / (1 - s**2), abs=0.005)  # 0.406
    assert rho3 == pytest.approx(0.127, abs=0.005)


def test_valve_that_never_moves_is_stuck_in_rho3_and_not_in_rho2():
    op = np.sin(np.arange(1000) / 20) ** 3
    rho1, rho2, rho3 = movement_indices(op, np.full(1000, 50.0))
    assert (rho1, rho2) == (1.0, 0.0)
    # between an OP that rises and one that falls the published rule still takes IS followed by DS
    # out
    assert rho3 == pytest.approx(0.0, abs=0.1)


def test_step_finds_stiction_that_fast_sampling_hides(loop):
    record = loop(**DELAYED, Ts=0.2, n=8000, noise=0.1, kind="flow", seed=2)
    record = LoopRecord(record.op, record.pv, record.Ts, kind="flow", process="self-regulating")
    fine, coarse = (
        judge(record, ["yamashita"], thresholds={"yamashita": {"step": s}})[0].score
        for s in (1, 10)
    )
    assert coarse > fine + 0.1


def test_recorded_valve_position_is_used_even_behind_an_integrating_process(loop):
    record = loop(**LEVEL, n=2500, kind="level")
    verdict = judge(record, ["yamashita"])[0]
    assert (verdict.verdict, verdict.applicable) == ("stiction", True)


def test_air_to_close_valve_is_judged_like_air_to_open(loop):
    record = loop(**DELAYED, n=2500, noise=0.05)
    scores = []
    for sign in (1.0, -1.0):
        flow = LoopRecord(record.op, sign * record.pv, 1.0, kind="flow")
        scores.append(judge(flow, ["yamashita"], thresholds={"yamashita": {"step": 10}})[0].score)
    assert scores[0] == pytest.approx(scores[1])
    assert scores[0] > 0.25

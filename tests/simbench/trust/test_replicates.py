"""Replicates are the loop of the record again: its length, its sampling, its set point, and no more
signals than it has.
"""

from dataclasses import replace

import numpy as np
import pytest
from random_case import random_case

from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.altered import with_friction
from simbench.gap.stiction.candidate_loops import candidate_loops
from simbench.trust import replicates as twins
from simbench.trust.replicates import Change, draw_replicates, levels


@pytest.fixture(scope="module")
def candidates():
    return candidate_loops(random_case(5, ("stiction",)).record)


def test_twins_have_the_records_length_sampling_and_signals(candidates):
    twins = draw_replicates(candidates, 4, 1)
    assert {t.record.n for t in twins} == {candidates.record.n}
    assert {t.record.Ts for t in twins} == {candidates.record.Ts}
    assert all((t.record.mv is None) == (candidates.record.mv is None) for t in twins)
    assert all(t.record.process == candidates.record.process for t in twins)


def test_a_healthy_twin_moves_about_as_much_as_the_record(candidates):
    sizes = [np.std(t.record.pv) for t in draw_replicates(candidates, 20, 0)]
    assert 0.3 < np.median(sizes) / np.std(candidates.record.pv) < 3.0


def test_friction_is_tried_with_a_disturbance_that_swings_the_loop(candidates, monkeypatch):
    driven = []
    whole = twins._driven
    monkeypatch.setattr(twins, "_driven", lambda *a: driven.append(1) or whole(*a))
    cell = [(1.0, 0.5)]
    swung = replace(candidates, log_odds=-5.0, period=40.0 * candidates.record.Ts)
    draw_replicates(swung, 0, 8, cells=cell)
    assert driven
    driven.clear()
    draw_replicates(replace(swung, period=None), 0, 8, cells=cell)
    assert not driven


def test_cells_span_small_and_large_friction(candidates):
    S = [s for s, _ in levels(candidates)]
    assert min(S) <= 1.0
    assert max(S) >= 5.0
    assert all(0 < j <= s for s, j in levels(candidates))


def test_what_is_recorded_otherwise_is_recorded_otherwise(candidates):
    n = candidates.record.n
    assert draw_replicates(candidates, 6, 0, change=Change(longer=2.0))[0].record.n == 2 * n
    assert draw_replicates(candidates, 6, 0, change=Change(faster=3))[0].record.Ts == pytest.approx(
        candidates.record.Ts / 3
    )
    assert draw_replicates(candidates, 6, 0, change=Change(mv=True))[0].record.mv is not None
    stepped = draw_replicates(candidates, 6, 0, change=Change(step=7.0))[0].record
    assert stepped.sp is None or np.ptp(stepped.sp) >= 7.0


def test_friction_replaces_friction(candidates):
    loop = with_friction(with_friction(candidates.healthy[0], 3.0, 1.0), 5.0, 2.0)
    mine = [e for e in loop.to_table()["effect"] if e["name"] == "stiction"]
    assert [(e["S"], e["J"]) for e in mine] == [(5.0, 2.0)]
    assert "stiction" not in str(with_friction(loop, 0.0, 0.0).to_table())


def test_a_record_whose_op_has_no_unit_keeps_its_unit():
    r = random_case(5, ("stiction",)).record
    odd = LoopRecord(op=1000.0 + 40.0 * r.op, pv=r.pv, sp=r.sp, Ts=r.Ts, process=r.process)
    assert odd.op_percent is None
    candidates = candidate_loops(odd)
    assert candidates.percent > 0
    assert candidates.record.op.min() >= 0.0
    assert np.allclose(np.diff(candidates.record.op) * candidates.percent, np.diff(odd.op))


def test_twins_depend_on_seed_and_number_alone(candidates):
    one, again = (draw_replicates(candidates, 2, 1, seed=3) for _ in range(2))
    assert all(np.array_equal(a.record.pv, b.record.pv) for a, b in zip(one, again))
    assert not np.array_equal(one[0].record.pv, one[1].record.pv)


def test_sticky_twins_share_the_two_explanations_by_their_probability(candidates):
    for odds in (-1.0, 0.5, 4.0):
        weighed = replace(candidates, log_odds=odds)
        sticky = [twins._of_sticky(weighed, k) for k in range(200)]
        assert np.mean(sticky) == pytest.approx(weighed.probability, abs=0.02)

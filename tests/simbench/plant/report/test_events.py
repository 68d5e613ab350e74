"""Loops share an event only where they were recorded at one time; a cascade is a pair."""

import time
from dataclasses import replace

import numpy as np

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.phase import coherence
from simbench.plant.report.events import cascades, same_time, shared_oscillations

T = np.arange(2000.0)
WEEK = 7 * 86400.0


def swinging(shift, start=None):
    x = np.sin(T / 8 + shift)
    return LoopRecord(x + 50, x, 1.0, meta={} if start is None else {"start": start})


def events(**records):
    return shared_oscillations({name: Prepared(r) for name, r in records.items()})


def test_loops_of_different_weeks_are_no_event():
    assert events(a=swinging(0, 1.7e9), b=swinging(1, 1.7e9)) == [["a", "b"]]
    assert events(a=swinging(0, 1.7e9), b=swinging(1, 1.7e9 + WEEK)) == []


def test_a_record_with_a_time_and_one_without_are_no_event():
    assert events(a=swinging(0, 1.7e9), b=swinging(1)) == []


def test_records_that_overlap_are_compared_where_they_do():
    one = swinging(0, 1.7e9)
    later = replace(swinging(500 / 8, 1.7e9 + 500))
    both = same_time(one, later)
    assert both is not None
    assert both[0].n == both[1].n == 1500
    assert np.allclose(both[0].pv, both[1].pv)
    assert events(a=one, b=later) == [["a", "b"]]


def test_the_set_point_of_a_cascade_s_inner_loop_is_the_outer_one_s_output():
    rng = np.random.default_rng(0)
    op = np.cumsum(rng.standard_normal(500)) + 50
    outer = LoopRecord(op, np.cumsum(rng.standard_normal(500)), 1.0)
    inner = LoopRecord(rng.standard_normal(500), 3 * op, 1.0, sp=3 * op + 2)
    other = LoopRecord(np.cumsum(rng.standard_normal(500)), op, 1.0)
    assert cascades({"TIC1": outer, "FIC1": inner, "LIC2": other}) == [("TIC1", "FIC1")]
    assert cascades({"TIC1": outer, "LIC2": other}) == []


def test_an_output_is_followed_one_sample_late_by_other_times_and_never_if_it_stands_still():
    rng = np.random.default_rng(2)
    op = np.cumsum(rng.standard_normal(600)) + 50
    still = LoopRecord(np.full(600, 50.0), op, 1.0)
    outer = LoopRecord(op, op, 1.0, meta={"start": 1.7e9})
    sp = 3 * op[99:499] + 2  # from sample 100 on, one sample late
    inner = LoopRecord(sp, sp, 1.0, sp=sp, meta={"start": 1.7e9 + 100})
    assert cascades({"TIC1": outer, "FIC1": inner, "LIC2": still}) == [("TIC1", "FIC1")]
    sure = {"SIC": replace(inner, meta={}), "TIC": LoopRecord(op[100:500], sp, 1.0), "XIC": still}
    assert cascades(sure) == [("TIC", "SIC")]


def test_a_plant_of_400_loops_whose_set_points_move_is_searched_in_seconds():
    rng = np.random.default_rng(3)
    moving = [50 + np.cumsum(rng.standard_normal((2, 2000)), axis=1) for _ in range(400)]
    plant = {f"L{k}": LoopRecord(op, op, 1.0, sp=sp) for k, (op, sp) in enumerate(moving)}
    plant["inner"] = LoopRecord(moving[1][0][::-1], moving[0][1], 1.0, sp=plant["L0"].op)
    since = time.process_time()
    assert cascades(plant) == [("L0", "inner")]
    assert time.process_time() - since < 6.0  # 1 s; 14 s if each pair is correlated anew


def test_a_swing_that_wanders_keeps_no_phase():
    rng = np.random.default_rng(1)
    wanders = np.sin(T / 8 + 0.2 * np.cumsum(rng.standard_normal(T.size)))
    assert coherence(np.sin(T / 8), 50.3) > 0.98
    assert coherence(wanders, 50.3) < 0.8

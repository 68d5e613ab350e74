"""Loops share an event only where they were recorded at one time."""

from dataclasses import replace

import numpy as np

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.events import event_numbers, same_time, shared_oscillations
from simbench.detectors.signal.filters import coherence

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


def test_loops_of_one_event_have_its_number_and_others_none():
    rng = np.random.default_rng(1)
    alone = LoopRecord(rng.standard_normal(2000) + 50, rng.standard_normal(2000), 1.0)
    assert event_numbers({"a": swinging(0), "x": alone, "b": swinging(1)}) == {"a": 1, "b": 1}


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


def test_a_swing_that_wanders_keeps_no_phase():
    rng = np.random.default_rng(1)
    wanders = np.sin(T / 8 + 0.2 * np.cumsum(rng.standard_normal(T.size)))
    assert coherence(np.sin(T / 8), 50.3) > 0.98
    assert coherence(wanders, 50.3) < 0.8

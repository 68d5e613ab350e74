"""Shares of a scenario's cost count: a slower machine is no regression, and they add up."""

import copy
from types import SimpleNamespace

from benchmarks import perf_shares

TOLD = {
    "fast": {"minimum_ms": 10.0, "share": {"hammerstein": 0.3, "glue": 0.1, "rest": 0.6}},
    "full": {"minimum_ms": 25.0, "share": {"surrogate": 0.4, "rest": 0.6}},
}


def test_a_slower_machine_is_no_regression():
    slower = copy.deepcopy(TOLD)
    for message in slower.values():
        message["minimum_ms"] *= 7.0
    assert perf_shares.grown(slower, TOLD) == []


def test_time_is_charged_to_whoever_runs_and_adds_up(monkeypatch):
    meter = perf_shares.Meter()
    clock = iter([1.0, 3.0, 4.0, 10.0, 11.0])
    monkeypatch.setattr(meter, "_since", 0.0)
    monkeypatch.setattr(perf_shares, "time", SimpleNamespace(process_time=lambda: next(clock)))
    inner = meter.wrap("inner", lambda: None)
    meter.wrap("outer", inner)()
    meter.charge()
    assert meter.seconds == {"glue": 2.0, "outer": 8.0, "inner": 1.0}

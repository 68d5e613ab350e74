"""What grids lack: units stay whole, and a known difference is told."""

import numpy as np

from results.studies.grid_gaps import KNOWN, halves, known_difference
from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark import nuisances


def test_units_stay_whole():
    records = {f"r{k}": LoopRecord(np.arange(3.0), np.arange(3.0), 1.0) for k in range(30)}
    units = {name: f"u{k // 3}" for k, name in enumerate(records)}
    one, other = halves(records, units)
    assert {*one, *other} == set(records)
    assert {units[n] for n in one}.isdisjoint(units[n] for n in other)
    assert len(one) == len(other)


def test_a_known_difference_is_told(monkeypatch):
    few = {name: nuisances.ADDITIONS[name] for name in (KNOWN[0], "white noise", "valve lag")}
    monkeypatch.setattr("results.studies.grid_gaps.ADDITIONS", few)
    block, before, after = known_difference(KNOWN[0], 0)
    assert block == "lattice"
    assert before > 0.95
    assert after < 0.7

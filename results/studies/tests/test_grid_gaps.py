"""The study of what grids lack: units stay whole, and every number of `list grids` is printed."""

import re
from pathlib import Path

import numpy as np
import pytest

from results.studies.grid_gaps import KNOWN, halves, known_difference, main
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark import nuisances
from simbench.scenarios.grid import load_grid
from simbench.scenarios.packaged import grid_names

PRINTED = Path("results/grid_gaps.txt").read_text(encoding="utf-8")


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


def test_what_the_list_of_grids_says_is_printed():
    stated = dict(re.findall(r"^(\S+) +([01]\.\d\d) \(", PRINTED, re.MULTILINE))
    for name in grid_names():
        told = load_grid(name).content.told_from_recorded
        assert (told is None) == (name not in stated), name
        assert told is None or f"{told:.2f}" == stated[name], name


def test_one_of_folders_and_draws_is_needed():
    for words in ([], ["folder", "--known", "2"]):
        with pytest.raises(ParameterError, match="one of both is needed"):
            main(words)

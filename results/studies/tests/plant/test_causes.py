"""Loops of the study of causes have separate weeks and archives, and are counted by cause."""

import numpy as np
import pytest

from results.studies.plant.causes import CAUSES, WEEK, archived, drawn, plant
from simbench.detectors.record import LoopRecord


@pytest.fixture(scope="module")
def loops():
    return plant(8, 1)


def test_every_loop_has_a_separate_week_but_a_victim_that_of_its_source(loops):
    starts = {name: record.meta["start"] for name, (_, record, _) in loops.items()}
    assert starts["4s"] == starts["4v"]
    assert len(set(starts.values())) == 8
    assert np.ptp(list(starts.values())) == 7 * WEEK
    assert sorted({cause for cause, _, _ in loops.values()}) == sorted(CAUSES)


def test_an_archive_of_exceptions_holds_values_and_one_of_lines_draws_them(tmp_path):
    record, _ = drawn("stiction", np.random.default_rng(3))
    assert isinstance(record, LoopRecord)
    held = archived(record, "exceptions", tmp_path / "a.csv")
    assert np.mean(np.diff(held.op) == 0.0) > 0.5
    third = archived(record, "every third", tmp_path / "a.csv")
    assert third.n == -(-record.n // 3)

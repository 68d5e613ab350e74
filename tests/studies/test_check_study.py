"""The study of the gate, small: every kind of fault is put in, and none of the harmless changes alarms."""

import numpy as np
import pytest

from detectors.plugins.registry import methods
from results.studies.check_study import BROKEN, study


@pytest.fixture(scope="module")
def small():
    return study("smoke", repeats=2, methods=["he", "yamashita", "rossi_scali"])


def test_harmless_changes_pass(small):
    quiet = small.table[small.table["kind"].isin(["same", "perturbed", "fresh seed"])]
    assert list(quiet["kind"].value_counts()[["same", "perturbed", "fresh seed"]]) == [1, 1, 2]
    assert not quiet["failed"].any()


def test_the_kick_makes_other_records_but_hardly_other_verdicts(small):
    (row,) = small.table[small.table["kind"] == "perturbed"].to_dict("records")
    # healthy loops without noise may round the kick away, sticky ones do not
    assert float(row["what"].partition("%")[0]) > 80
    assert row["flips"] <= 15


def test_every_detector_is_broken_in_every_way_and_most_of_it_is_seen_even_on_48_loops(small):
    broken = small.table[small.table["kind"] == "broken"]
    assert len(broken) == 3 * len(BROKEN)
    assert broken.loc[broken["what"] == "always stiction", "failed"].all()
    assert broken.loc[broken["method"] == "yamashita", "failed"].all()


def test_every_threshold_is_moved_within_its_bounds(small):
    moved = small.table[small.table["kind"] == "threshold"]
    assert set(moved["method"]) == {"he", "yamashita", "rossi_scali"}
    for row in moved.to_dict("records"):
        rule = methods.load(row["method"]).METHOD.thresholds[row["what"]]
        assert rule.low <= row["to"] <= rule.high
        assert np.isclose(abs(row["to"] / rule.default - 1), 0.2)
    assert moved["flips"].sum() > 0


def test_texts_name_promises_and_faults_that_passed(small):
    text = small.as_text()
    assert "held     records perturbed by 1e-12 pass" in text
    assert "threshold" in text
    assert len(small.as_json()["rows"]) == len(small.table)

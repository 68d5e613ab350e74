"""The quick study of the gate, on few loops and methods."""

import numpy as np
import pytest

from results.studies.check_study import BROKEN
from results.studies.gate import finer, study


def test_finer_steps_keep_the_old_ones():
    steps = np.geomspace(0.1, 10.0, 9)
    assert set(steps) <= set(finer(steps))
    assert finer(steps).size == 17
    assert (np.diff(finer(steps)) > 0).all()


@pytest.fixture(scope="module")
def rows():
    return study("smoke", {}, ("he", "rossi_scali", "yamashita", "ellipse"))


def test_rewrites_pass_and_keep_nearly_every_verdict(rows):
    kept = [row for row in rows if row["what"] not in BROKEN]
    wanted = {("he", "finer"), ("rossi_scali", "finer"), ("ellipse", "axes exchanged"), ("yamashita", "last bits")}
    assert wanted <= {(row["method"], row["what"]) for row in kept}
    assert not any(row["failed"] for row in kept)
    assert all(row["as_wanted"] for row in kept)
    assert all(row["flips"] <= 2 for row in kept)


def test_what_is_broken_fails(rows):
    broken = [row for row in rows if row["what"] in BROKEN]
    assert len(broken) >= 10
    assert all(row["failed"] == row["as_wanted"] for row in broken)
    assert np.mean([row["failed"] for row in broken]) > 0.5  # few loops

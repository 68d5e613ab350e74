"""The quick study of the gate, on few loops and methods."""

import numpy as np
import pytest

from results.studies.gate import BROKEN, SEMANTIC, finer, rewritten, study
from simbench.bench.execute.run import run_grid
from simbench.bench.store.reading import RunArrays


def test_finer_steps_keep_the_old_ones():
    steps = np.geomspace(0.1, 10.0, 9)
    assert set(steps) <= set(finer(steps))
    assert finer(steps).size == 17
    assert (np.diff(finer(steps)) > 0).all()


@pytest.fixture(scope="module")
def rows():
    return study("smoke", {}, ("he", "rossi_scali", "yamashita", "ellipse"))


@pytest.mark.slow
def test_40_harmless_changes_of_which_none_is_called_worse(rows):
    kept = [
        row
        for row in rows
        if row["what"] in ("finer", "axes exchanged", "last bits") or "order" in row["what"]
    ]
    wanted = {
        ("he", "finer"),
        ("rossi_scali", "finer"),
        ("ellipse", "axes exchanged"),
        ("yamashita", "last bits"),
    }
    assert wanted <= {(row["method"], row["what"]) for row in kept}
    assert len(kept) == 40
    assert all(row["flips"] <= 2 for row in kept if "order" not in row["what"])
    # on 48 loops a lost one leaves the gate unable to tell
    assert sum(row["failed"] for row in kept) <= 4
    assert not any(row["failed"] for row in kept if row["flips"] == 0)


@pytest.mark.slow
def test_what_is_broken_is_caught_even_on_48_loops(rows):
    broken = [row for row in rows if row["what"] in BROKEN or "loops of" in row["what"]]
    assert len(broken) >= 20
    assert all(row["failed"] for row in broken if row["flips"] != 0)


@pytest.mark.slow
def test_a_detector_that_is_not_itself_is_caught(rows):
    moody = [row for row in rows if row["what"] == "2 % at random"]
    assert len(moody) == 2
    assert all(row["failed"] == row["as_wanted"] for row in moody)


@pytest.mark.slow
def test_small_changes_of_what_a_method_computes_are_caught_by_exact(rows):
    small = [row for row in rows if row["what"] in SEMANTIC]
    assert {row["method"] for row in small} == {"he", "yamashita"}  # of the four methods asked
    # on 48 loops a small change need not change a verdict
    assert all(row["exact"] for row in small if row["flips"])
    assert all(row["exact"] for row in rows if row["what"] in BROKEN and row["flips"])


@pytest.mark.slow
def test_small_changes_change_what_a_method_computes_and_nothing_else(tmp_path):
    methods = ["he", "horch", "singhal_salsbury", "yamashita"]
    folder = run_grid(
        "smoke", tmp_path / "run", methods, sets={"disturbance": "none"}, progress=False
    )
    base, seen = RunArrays.read(folder), set()
    for method, how, now in rewritten(base, folder, SEMANTIC, last_bits=False):
        i = base.methods.index(method)
        assert not np.allclose(
            now.score[i], base.score[i].astype(np.float32), rtol=1e-3, equal_nan=True
        ), how
        others = [k for k in range(len(methods)) if k != i]
        assert np.array_equal(now.verdict[others], base.verdict[others])
        seen.add((method, how))
    assert len(seen) == 5

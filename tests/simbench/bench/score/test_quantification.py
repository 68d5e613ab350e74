"""S and J scored: errors in shares of S, coverage of stated intervals alone, and a gate that sees
both become worse.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.check.baseline import write_baseline
from simbench.bench.check.check import check_books
from simbench.bench.execute.run import run_grid
from simbench.bench.score.quantification import quantification
from simbench.bench.score.scoring import score_run
from simbench.bench.store.reading import read_book

N = 200
S, J = 4.0, 2.0


@pytest.fixture
def sized(book):
    """Return a function that makes a run of 200 sticky loops with the S intervals and J numbers of
    one method.
    """

    def make(lo, hi, j=J, stated=("S",)):
        run = book(np.ones(N), np.ones(N), axes={"valve": np.array(["kano"] * N, dtype=object)})
        sizes = np.empty((4, 1, N), np.float32)
        sizes[:, 0] = np.array([np.full(N, end) for end in (lo, hi, j, j)])
        run.manifest["methods"]["m0"] = {**run.manifest["methods"]["m0"], "stated": stated}
        return replace(run, friction=np.tile([S, J], (N, 1)), sizes=sizes)

    return make


def held(share, wide=1.0):
    """Return ends of intervals of which a share holds S."""
    out = np.arange(N) >= share * N
    return np.where(out, S + 0.1, S - wide), np.where(out, S + 0.1 + wide, S + wide)


def test_errors_and_widths_are_shares_of_s_and_coverage_is_counted(sized):
    rows = {r.parameter: r for r in quantification(sized(*held(0.9), j=3.0)).itertuples()}
    assert (rows["S"].family, rows["S"].n, rows["S"].coverage) == ("kano", N, pytest.approx(0.9))
    assert rows["S"].width == pytest.approx(2.0 / S)
    assert rows["S"].median_error == pytest.approx(0.0)
    assert rows["J"].median_error == pytest.approx(1.0 / S)
    assert np.isnan(rows["J"].coverage)


def test_the_gate_passes_what_did_not_change(sized):
    check = check_books(sized(*held(0.9)), sized(*held(0.9)))
    assert check.result == "same"
    assert set(check.tests.what) >= {"coverage", "median error"}


def test_a_fall_of_coverage_fails(sized):
    check = check_books(sized(*held(0.7)), sized(*held(0.9)))
    assert check.result == "worse"
    assert "coverage of S of kano fell from 0.900 to 0.700" in " ".join(check.reasons)


def test_a_rise_of_the_median_error_fails(sized):
    check = check_books(sized(*held(0.9), j=J + 1.0), sized(*held(0.9), j=J))
    assert check.result == "worse"
    assert "median error of J of kano rose from 0.000 to 0.250" in " ".join(check.reasons)


def test_a_fall_within_the_margin_passes_and_one_that_may_be_chance_is_left_open(sized):
    assert check_books(sized(*held(0.88)), sized(*held(0.9))).result == "same"
    other = np.random.default_rng(0).permutation(N)
    lo, hi = held(0.86)
    check = check_books(sized(lo[other], hi[other]), sized(*held(0.9)))
    assert check.result == "cannot tell"


def test_a_method_that_gives_no_size_any_more_cannot_be_compared(sized):
    run = sized(*held(0.9))
    fewer = run.sizes.copy()
    fewer[:, :, N // 2 :] = np.nan
    check = check_books(replace(run, sizes=fewer), run)
    assert check.result == "cannot tell"
    assert "given 100 times, before 200" in " ".join(check.reasons)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return run_grid(
        "smoke",
        tmp_path_factory.mktemp("sizes") / "run",
        ["hammerstein", "kano_a"],
        sets={"repeats": 2},
    )


def test_a_run_is_scored_printed_and_kept_as_baseline(finished, tmp_path):
    scored = json.loads(json.dumps(score_run(finished).as_json(), allow_nan=False))[
        "quantification"
    ]
    keys = "method,family,parameter,n,median_error,coverage,width"
    assert {",".join(row) for row in scored} == {keys}
    rows = {(r["method"], r["family"], r["parameter"]): r for r in scored}
    hammerstein = rows["hammerstein", "choudhury", "S"]
    assert hammerstein["median_error"] < 0.3
    assert hammerstein["coverage"] > 0.6
    assert rows["kano_a", "choudhury", "S"]["coverage"] is None
    assert "S and J of sticky loops" in score_run(finished).as_text(full=True)
    write_baseline(finished, tmp_path / "base")
    again = check_books(read_book(finished), read_book(tmp_path / "base"))
    assert again.result == "same"
    assert (
        again.tests.query("what == 'median error'")[["before", "now"]].diff(axis=1)["now"] == 0
    ).all()

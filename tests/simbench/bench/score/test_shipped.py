"""Verdicts that are shipped with the package stand beside those of a run as if they had been asked
again.
"""

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import simbench as sb
from results.studies import shipped as study
from results.studies.shipped import GRIDS, ask_again
from simbench.bench.check.baseline import write_baseline
from simbench.bench.execute.run import run_grid
from simbench.bench.score import shipped
from simbench.bench.score.scoring import score_book, score_run
from simbench.bench.store.benchmark import evaluator_hash
from simbench.bench.store.folder import RunError
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.reading import RunArrays
from simbench.cli import main
from simbench.detectors.plugins.registry import methods
from simbench.scenarios.settled import table_file

SHIPPED = ["horch", "he"]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Verdicts of two methods on a small grid, shipped, and runs of others on it."""
    place = tmp_path_factory.mktemp("shipped")
    write_baseline(run_grid("smoke", place / "theirs", SHIPPED), place / "shipped" / "smoke")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shipped, "FOLDER", place / "shipped")
        run_grid("smoke", place / "mine", ["yamashita"], with_reference=True)
        run_grid("smoke", place / "all", ["yamashita", *SHIPPED])
    return place


@pytest.fixture
def place(runs, monkeypatch):
    """Return the folder of the runs, whose verdicts are those that the package ships."""
    monkeypatch.setattr(shipped, "FOLDER", runs / "shipped")
    return runs


def rows_of(folder):
    rows = score_run(folder).table.drop(columns=["median_ms"])
    return rows.sort_values(["method", "truth", "process", "population"]).reset_index(drop=True)


def test_scores_are_those_of_a_run_that_asks_all_methods(place):
    pd.testing.assert_frame_equal(rows_of(place / "mine"), rows_of(place / "all"), rtol=1e-6)
    assert list(read_manifest(place / "mine")["methods"]) == ["yamashita"]


def test_a_run_with_shipped_verdicts_is_scored_later_as_at_once(place, capsys):
    assert main(["score", str(place / "mine"), "--full"]) == 0
    assert "horch" in capsys.readouterr().out


def test_a_record_with_other_last_bits_has_its_shipped_verdict_and_is_counted(place):
    book = RunArrays.read(place / "mine")
    book.hashes[0] = b"another"
    given = RunArrays.read(place / "theirs")
    assert np.array_equal(shipped.with_shipped(book).verdict[1:], given.verdict)
    said = " ".join(score_book(book).as_text().split())
    assert "1 records have other last bits than those of the shipped verdicts" in said


def test_verdicts_of_another_benchmark_version_are_not_joined(place):
    book = RunArrays.read(place / "mine")
    book.manifest["benchmark"]["parts"]["evaluator"] = book.manifest["benchmark"]["hash"] = "other"
    with pytest.raises(RunError, match="different benchmark versions"):
        shipped.with_shipped(book)


@pytest.mark.parametrize(
    "more", [["--axis", "tuning=slow"], ["--set", "seed=3"], ["--fresh-seeds"]]
)
def test_only_loops_of_the_grid_of_the_package_have_shipped_verdicts(place, tmp_path, capsys, more):
    words = ["run", "smoke", "-o", str(tmp_path / "run"), "--with-reference", *more]
    assert main(words) == 2
    assert "needs a run without --set, --axis and --fresh-seeds" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_grid_without_shipped_verdicts_is_refused_before_anything_is_simulated(
    place, tmp_path, capsys
):
    assert main(["run", "families", "-o", str(tmp_path / "run"), "--with-reference"]) == 2
    assert "no verdicts on grid 'families' are shipped" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("grid", GRIDS)
def test_what_the_package_ships_is_of_its_own_version_and_complete(grid):
    manifest = read_manifest(shipped.shipped(grid))
    assert manifest["benchmark"]["parts"]["evaluator"] == evaluator_hash()
    assert set(manifest["methods"]) == {*methods.every_name(), "oracle"}
    table = sb.results(grid)
    assert set(table.method) == set(manifest["methods"])
    assert len(table) == manifest["counts"]["verdicts"]
    frozen = pq.read_table(table_file(grid), columns=["scenario_id"]).column(0).to_pylist()
    assert set(table.scenario_id) == set(frozen)


@pytest.mark.parametrize("grid", GRIDS)
def test_a_share_of_what_is_shipped_comes_out_the_same_when_it_is_asked_again(grid):
    found = ask_again(grid, 0.01, seed=3, but=["likelihood"])
    assert found.loops > 8
    assert found.differ == ()


@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_shipped_verdicts_hold_no_loops_and_say_which_grid_has_them(tmp_path, capsys, verb):
    folder, ident = str(shipped.shipped("plant")), sb.results("plant").scenario_id[0]
    words = {"run": [folder], "simulate": ["--from", folder, "--id", ident]}[verb]
    assert main([verb, *words, "-o", str(tmp_path / "out")]) == 2
    assert "`simbench run plant`" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_the_command_prints_verdicts_and_states_a_new_version_where_a_share_agrees(
    tmp_path, monkeypatch, capsys
):
    for module in (shipped, study):
        monkeypatch.setattr(module, "FOLDER", tmp_path / "shipped")
    monkeypatch.setattr(study, "METHODS", ("he",))
    assert study.main(["smoke", "-o", str(tmp_path / "runs")]) == 0
    assert "smoke: 48 loops, 1 methods" in capsys.readouterr().out
    folder = tmp_path / "shipped" / "smoke"
    given = read_manifest(folder)
    other = {**given["benchmark"], "parts": {**given["benchmark"]["parts"], "evaluator": "old"}}
    write_manifest(folder, {**given, "benchmark": other})
    assert study.main(["smoke", "--again", "0.1"]) == 0
    assert "0 answers or labels differ" in capsys.readouterr().out
    assert read_manifest(folder)["benchmark"] == given["benchmark"]


def test_rows_that_need_the_records_are_left_out_of_what_is_shipped_without_them():
    scores = score_run(shipped.FOLDER / "chapter")
    assert not {"no_waveform", "rhythm"} & set(scores.table.method)
    assert scores.table.cost_over_no_waveform.isna().all()
    assert "Rows no_waveform and rhythm need the records" in " ".join(scores.as_text().split())


def test_the_page_of_shipped_verdicts_says_what_is_not_stored(tmp_path, capsys):
    page = tmp_path / "page.html"
    run = str(shipped.FOLDER / "table-11-3")
    assert main(["score", run, "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "Rows no_waveform and rhythm need the records" in text

"""Methods that are added to a finished run have the rows of methods that were asked at once."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from bench_fixtures import NEVER, raise_after

import simbench as sb
from simbench.bench.check.baseline import write_baseline
from simbench.bench.execute import compute_piece, pieces
from simbench.bench.execute.add import add_to_run
from simbench.bench.execute.run import run_grid
from simbench.bench.score.scoring import score_run
from simbench.bench.store import manifest
from simbench.bench.store.folder import RunError
from simbench.bench.store.manifest import read_manifest
from simbench.cli import main
from simbench.detectors.errors import UserError
from simbench.detectors.verdict import Verdict
from simbench.scenarios.grid import load_grid


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A plug-in and a run without it, never to be changed."""
    place = tmp_path_factory.mktemp("add")
    (place / "never.py").write_text(NEVER)
    run_grid("smoke", place / "run", ["he", "oracle"], n=12)
    return place


@pytest.fixture(scope="module")
def at_once(tmp_path_factory):
    """The run of which all methods were asked at once, never to be changed."""
    folder = tmp_path_factory.mktemp("at_once") / "run"
    return run_grid("smoke", folder, ["he", "horch", "oracle"], n=12)


@pytest.fixture
def run(place, tmp_path):
    return shutil.copytree(place / "run", tmp_path / "run")


def tables(run):
    verdicts = pd.read_parquet(run / "verdicts.parquet").drop(columns="runtime_s")
    return pd.read_parquet(run / "scenarios.parquet"), verdicts


def rows(run):
    return score_run(run).table.drop(columns="median_ms")


def assert_same_run(one, other):
    for a, b in zip(tables(one), tables(other), strict=True):
        pd.testing.assert_frame_equal(a, b)
    pd.testing.assert_frame_equal(rows(one), rows(other))
    states = [read_manifest(run) for run in (one, other)]
    for key in ("methods", "plugins", "counts", "records_hash", "benchmark", "grid_hash"):
        assert states[0][key] == states[1][key], key


def write_answers(run, file, method, name, records=slice(None)):
    """Write the answers of a run's method to a file under another name, the last record first."""
    verdicts = tables(run)[1]
    of = verdicts[verdicts.method == method].iloc[records][::-1]
    columns = {"record": of.scenario_id, "verdict": of.verdict, "score": of.score}
    pd.DataFrame({"method": name, **columns}).to_csv(file, index=False)


def test_methods_asked_later_have_the_rows_of_methods_asked_at_once(place, run, tmp_path):
    plugins = [place / "never.py"]
    at_once = run_grid(
        "smoke", tmp_path / "once", ["he", "horch", "oracle", "never"], plugins=plugins, n=12
    )
    added = add_to_run(run, ["horch", "never"], plugins=plugins)
    assert (added.folder, added.told) == (run, "added: horch, never")
    assert_same_run(at_once, run)
    assert {p.name for p in tmp_path.iterdir()} == {"once", "run"}


def test_a_detector_that_the_run_has_is_refused(place, run, tmp_path):
    plugins = [place / "never.py"]
    with pytest.raises(RunError, match="no method is named"):
        add_to_run(run)
    add_to_run(run, ["never"], plugins=plugins)
    with pytest.raises(RunError, match="'never' already"):
        add_to_run(run, ["never", "horch"], plugins=plugins)
    write_answers(run, tmp_path / "horch.csv", "he", "never2")
    text = (tmp_path / "horch.csv").read_text().replace("never2", "never")
    (tmp_path / "never.csv").write_text(text)
    with pytest.raises(RunError, match="'never' already"):
        add_to_run(run, add=False, answers=[tmp_path / "never.csv"])


def test_a_function_is_added_from_python(run):
    def late(prepared):
        """Answer by the last sample."""
        last = float(prepared.record.op[-1] - 50.0)
        verdict = "stiction" if last > 0 else "no_stiction"
        return Verdict("late", verdict, last, reason="last sample of OP")

    assert sb.run(run, late, add=True, progress=False) == run
    assert "late" in read_manifest(run)["methods"]
    assert rows(run).set_index("method").own["late"].all()
    with pytest.raises(UserError, match="its folder is needed"):
        sb.run(load_grid("smoke"), late, add=True)


def test_beside_shipped_verdicts_too(place, tmp_path):
    never, plugins = ["never"], [place / "never.py"]
    settings = {"n": 12, "with_reference": True}
    at_once = run_grid("ci", tmp_path / "once", ["horch", *never], plugins=plugins, **settings)
    later = run_grid("ci", tmp_path / "later", ["horch"], n=12)
    add_to_run(later, never, plugins=plugins, with_reference=True)
    assert "hammerstein" in set(rows(later).method)
    assert_same_run(at_once, later)


def test_a_missing_answer_is_no_decision_and_counted(place, run, tmp_path):
    write_answers(run, tmp_path / "mine.csv", "he", "mine", slice(3, None))
    told = add_to_run(run, add=False, answers=[tmp_path / "mine.csv"]).told
    assert told.endswith("mine, 3 of 12 records not answered")
    assert "The file of mine leaves 3 records unanswered" in score_run(run).as_text()
    verdicts = tables(run)[1]
    mine = verdicts[verdicts.method == "mine"]
    assert mine.verdict[mine.reason == "not answered"].tolist() == ["no_decision"] * 3
    assert len(mine) == 12


@pytest.mark.parametrize("separator", [";", "\t"])
def test_answers_may_be_apart_by_what_other_countries_write(run, tmp_path, separator):
    ids = tables(run)[0].scenario_id
    rows = [
        ["method", "record", "verdict", "score", "S"],
        ["mine", ids[0], "stiction", "0,75", "2,5..4"],
        ["mine", ids[1], "no_stiction", "0.25", ""],
    ]
    text = "\r\n".join(map(separator.join, rows))
    (tmp_path / "mine.csv").write_bytes(text.encode("utf-8-sig"))
    add_to_run(run, add=False, answers=[tmp_path / "mine.csv"])
    verdicts = tables(run)[1]
    mine = verdicts[verdicts.method == "mine"].set_index("scenario_id")
    assert mine.loc[ids[:2], "score"].tolist() == [0.75, 0.25]
    assert mine.loc[ids[0], ["S_lo", "S_hi"]].tolist() == [2.5, 4.0]


ID = "ID"  # stands for a record of the run
FILES = {
    "unknown record": ("method,record,verdict\nmine,zz,stiction\n", "line 2.*'zz'"),
    "unknown verdict": (f"method,record,verdict\nmine,{ID},yes\n", "line 2.*'yes'.*no_stiction"),
    "package": (f"method,record,verdict\nHorch,{ID},stiction\n", "line 2.*'Horch'.*'horch'"),
    "reference": (f"method,record,verdict\noracle,{ID},stiction\n", "line 2.*'oracle'"),
    "column": (f"method,record,verdct\nmine,{ID},stiction\n", "line 1.*verdct.*verdict"),
    "cells": (f"method,record,verdict\nmine,{ID},stiction,4\n", "no table of answers"),
    "number": (f"method,record,verdict,score\nmine,{ID},stiction,x\n", "line 2.*score = 'x'"),
    "size": (f"method,record,verdict,S\n\nmine,{ID},stiction,-1\n", "line 3.*S = '-1'"),
    "empty": ("", "no table of answers"),
    "no rows": ("method,record,verdict\n", "no answers"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_wrong_file_is_one_sentence_and_the_run_stays(run, tmp_path, case):
    text, words = FILES[case]
    file = tmp_path / "mine.csv"
    file.write_text(text.replace(ID, tables(run)[0].scenario_id[0]))
    before = tables(run)[1]
    with pytest.raises(UserError, match=words) as error:
        add_to_run(run, add=False, answers=[file])
    assert "\n" not in str(error.value)
    assert "mine.csv" in str(error.value)
    pd.testing.assert_frame_equal(before, tables(run)[1])
    assert {p.name for p in tmp_path.iterdir()} == {"run", "mine.csv"}


def test_who_answers_twice_is_refused(run, tmp_path):
    ident = tables(run)[0].scenario_id[0]
    file = tmp_path / "mine.csv"
    file.write_text(f"method,record,verdict\nmine,{ident},stiction\nmine,{ident},no_stiction\n")
    with pytest.raises(UserError, match=r"line 3.*in line 2"):
        add_to_run(run, add=False, answers=[file])
    write_answers(run, file, "he", "mine")
    with pytest.raises(RunError, match="'mine' already"):
        add_to_run(run, add=False, answers=[file, file])
    add_to_run(run, add=False, answers=[file])
    with pytest.raises(RunError, match="'mine' already"):
        add_to_run(run, add=False, answers=[file])


def test_what_is_no_finished_run_of_this_code_is_refused(place, run, tmp_path, monkeypatch):
    write_baseline(run, tmp_path / "baseline")
    with pytest.raises(RunError, match="baseline"):
        add_to_run(tmp_path / "baseline", ["horch"])
    with pytest.raises(RunError, match=r"has all methods.*he"):
        add_to_run(run, ["he"])
    monkeypatch.setattr(manifest, "code_hash", lambda: "another")
    with pytest.raises(RunError, match=r"the code differs.*another"):
        add_to_run(run, ["horch"])


def test_a_loop_that_failed_has_failed_for_the_added_method_too(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        raise_after(patch, compute_piece, "simulate_with_truth", 3, ArithmeticError("by design"))
        run = run_grid("smoke", tmp_path / "run", ["he"], n=4)
    add_to_run(run, ["horch"])
    verdicts = tables(run)[1]
    failed = verdicts[verdicts.error.notna()].drop(columns="method")
    assert len(failed) == 2
    pd.testing.assert_series_equal(failed.iloc[0], failed.iloc[1], check_names=False)
    assert read_manifest(run)["counts"]["errors"] == 2


def test_a_call_that_fails_leaves_the_run_as_it_was_and_goes_on_with_resume(run, monkeypatch):
    before = tables(run)[1]
    with monkeypatch.context() as patch:
        raise_after(patch, pieces, "records_hash", 1, OSError("no space"))
        with pytest.raises(OSError, match="no space"):
            add_to_run(run, ["horch"])
    pd.testing.assert_frame_equal(before, tables(run)[1])
    monkeypatch.setattr(compute_piece, "judge_record", None)  # nobody is asked again
    assert add_to_run(run, ["horch"], resume=True).told == "added: horch"
    assert set(tables(run)[1].method) == {"he", "horch", "oracle"}


@pytest.mark.parametrize("renamed", range(5))
def test_a_kill_at_any_change_of_a_name_leaves_the_run_or_the_run_with_the_method(
    run, at_once, monkeypatch, renamed
):
    names = sorted(file.name for file in run.iterdir())
    number, rename = run.stat().st_ino, Path.replace
    left = iter(range(renamed))

    def killed(self, target):
        of_exchange = {"joined", "whole"} & set(self.parts) and self.name[0] != "."
        if of_exchange and next(left, None) is None:
            raise KeyboardInterrupt
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            add_to_run(run, ["horch"])
    assert ("horch" in set(rows(run).method)) == (renamed > 0)
    if not renamed:
        add_to_run(run, ["horch"], resume=True)
    assert_same_run(run, at_once)
    # a folder that is a mount point cannot change its name
    assert (run.stat().st_ino, sorted(file.name for file in run.iterdir())) == (number, names)


def test_a_name_may_be_as_long_as_the_disk_takes_it(run, tmp_path):
    long = tmp_path / ("r" * 255)
    add_to_run(run, ["horch"], long)
    assert {"he", "horch", "oracle"} <= set(rows(long).method)


def test_on_the_command_line_into_another_folder(place, run, tmp_path, capsys):
    out = tmp_path / "more"
    words = ["run", str(run), "--add", "--method", "horch", "-o", str(out), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["run"], told["added"]) == (str(out), "added: horch")
    assert "horch" not in read_manifest(run)["methods"]
    assert main(words) == 2
    assert "new or an empty folder" in capsys.readouterr().err
    for wrong, word in (
        (["ci", "--add"], "GRID is ci"),
        ([str(run), "--add", "--n", "4"], "--n"),
        ([str(run), "--answers", "no.csv"], "no.csv"),
    ):
        assert main(["run", *wrong]) == 2
        assert word in capsys.readouterr().err

"""A manifest is enough to make the same run; what it does not state alike is refused or said."""

import json
import shutil

import pandas as pd
import pytest
from bench_fixtures import NEVER

from simbench.bench.check.baseline import write_baseline
from simbench.bench.execute.repeat import compared, run_again
from simbench.bench.execute.run import run_grid
from simbench.bench.store.folder import RunError
from simbench.bench.store.manifest import read_manifest
from simbench.cli import main


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A run with another seed and axis, a sample of the grid, by a method and a plug-in."""
    place = tmp_path_factory.mktemp("first")
    (place / "never.py").write_text(NEVER)
    return run_grid(
        "smoke",
        place / "run",
        ["he", "never", "oracle"],
        plugins=[place / "never.py"],
        n=6,
        sets={"seed": 11},
        axes={"noise_ratio": [0.05, 0.2]},
    )


def tables(run):
    verdicts = pd.read_parquet(run / "verdicts.parquet").drop(columns="runtime_s")
    return pd.read_parquet(run / "scenarios.parquet"), verdicts


def test_the_manifest_alone_makes_the_same_run(first, tmp_path):
    handed_on = tmp_path / "theirs.json"
    shutil.copy(first / "manifest.json", handed_on)
    plugin = first.parent / "never.py"
    again = run_again(handed_on, tmp_path / "again", jobs=2, plugins=[plugin])
    for one, other in zip(tables(first), tables(again.folder), strict=True):
        pd.testing.assert_frame_equal(one, other)
    assert again.told == "all 6 records have the bits that the manifest states"
    assert again.scores is not None
    was, now = read_manifest(first), read_manifest(again.folder)
    assert (was["overrides"], was["points"]) == (now["overrides"], now["points"])


def test_on_the_command_line_the_answer_says_whether_the_bits_are_the_same(first, tmp_path, capsys):
    words = ["run", "--again", str(first), "-o", str(tmp_path / "again")]
    plugin = ["--plugin", str(first.parent / "never.py")]
    assert main([*words, *plugin]) == 0
    assert "again: all 6 records have the bits" in capsys.readouterr().out
    assert main([*words, *plugin, "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["again"].startswith("all 6 records")


def test_a_run_keeps_the_sources_of_its_plug_ins_by_which_it_runs_again(first, tmp_path):
    kept = tmp_path / "handed_on"
    shutil.copytree(first, kept)
    again = run_again(kept, tmp_path / "again", plugins=[kept / "plugins" / "never.py"])
    assert again.told == "all 6 records have the bits that the manifest states"
    assert (again.folder / "plugins" / "never.py").read_text() == NEVER


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "plug-in never: its file is needed (--plugin FILE.py)"),
        (["--plugin", "OTHER"], "plugins differ: never was"),
        (["--n", "3", "--set", "seed=1"], "leave out --n, --set"),
        (["smoke", "--method", "he"], "leave out GRID smoke, --method"),
    ],
)
def test_what_is_not_the_stated_run_is_refused(first, tmp_path, capsys, words, said):
    (tmp_path / "never.py").write_text(NEVER.replace("always", "ever"))
    words = [str(tmp_path / "never.py") if w == "OTHER" else w for w in words]
    out = tmp_path / "out"
    assert main(["run", *words, "--again", str(first), "-o", str(out)]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not out.exists()


def test_neither_grid_nor_manifest_is_refused(capsys):
    assert main(["run"]) == 2
    assert "GRID is missing" in capsys.readouterr().err


def test_a_baseline_is_no_run_and_is_said_to_be_a_grid(first, tmp_path):
    write_baseline(first, tmp_path / "kept")
    with pytest.raises(RunError, match="is a baseline, no run: `simbench run"):
        run_again(tmp_path / "kept", tmp_path / "again")


def test_a_run_of_loops_from_another_run_needs_its_tables(first, tmp_path):
    second = run_grid(first, tmp_path / "second", ["horch"])
    alone = tmp_path / "alone.json"
    shutil.copy(second / "manifest.json", alone)
    with pytest.raises(RunError, match="folder with them is needed"):
        run_again(alone, tmp_path / "third")
    assert run_again(second, tmp_path / "third").told.startswith("all 6 records")


def test_a_detector_of_python_can_only_be_run_again_from_there(first, tmp_path):
    def mine(prepared):
        return prepared is None

    run = run_grid("smoke", tmp_path / "run", mine, n=2)
    with pytest.raises(RunError, match="mine was handed over in Python"):
        run_again(run, tmp_path / "again")


def test_what_differs_is_said(first):
    was = read_manifest(first)
    now = {**was, "code": "other", "records_hash": "other"}
    assert compared(was, now) == (
        "of 6 records some have other bits than the manifest states; not the same: the code"
    )

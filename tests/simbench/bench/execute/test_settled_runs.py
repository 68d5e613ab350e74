"""Runs whose scenarios were settled before: from the table of the package, from a run, from a
baseline.
"""

import json
import math

import pandas as pd
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.scenario import resolve
from simbench.bench.store.benchmark import grid_of
from simbench.bench.store.manifest import RunError, read_manifest
from simbench.scenarios.grid import load_grid


def settles_nothing(monkeypatch):
    def settle(*_):
        raise AssertionError("a scenario was settled")

    monkeypatch.setattr(resolve, "measure_cycle", settle)


def loops_of(run):
    return pd.read_parquet(run / "scenarios.parquet")[["scenario_id", "loop_digest", "record_hash"]]


def test_a_grid_of_the_package_is_read_from_its_table_and_settled_again_when_asked(
    tmp_path, monkeypatch
):
    again = run_grid(load_grid("smoke"), tmp_path / "again", ["he"])
    settles_nothing(monkeypatch)
    there = run_grid("smoke", tmp_path / "there", ["he"])
    assert loops_of(there).equals(loops_of(again))
    said = [read_manifest(run) for run in (there, again)]
    assert said[0]["benchmark"] == said[1]["benchmark"]
    with pytest.raises(RunError, match="cannot be resumed: the grid differs"):
        run_grid("smoke", tmp_path / "again", ["he"], resume=True)


@pytest.mark.parametrize(
    "more",
    [{"n": 3}, {"sets": {"seed": 4}}, {"axes": {"disturbance": ["none"]}}],
)
def test_the_loops_of_a_run_stand_as_they_are(finished, tmp_path, more):
    with pytest.raises(RunError, match="is a run, whose loops are simulated as they stand"):
        run_grid(finished, tmp_path / "again", ["he"], **more)
    assert not (tmp_path / "again").exists()


def test_a_folder_without_a_run_is_no_grid(tmp_path):
    with pytest.raises(RunError, match="holds no run"):
        run_grid(tmp_path, tmp_path / "again", ["he"])


def test_a_manifest_is_strict_json_and_gives_back_infinite_numbers(tmp_path):
    axes = {"S_over_2J": [math.inf, 0.5], "disturbance": ["none"]}
    run = run_grid("smoke", tmp_path / "run", ["he"], axes=axes)

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    json.loads((run / "manifest.json").read_text(), parse_constant=refuse)
    (block,) = {b.axes["S_over_2J"] for b in grid_of(read_manifest(run)).content.block}
    assert block == (math.inf, 0.5)

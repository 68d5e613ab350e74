"""A map: files as promised, the same for any workers, resumed without a trace; what cannot be
mapped is refused.
"""

import hashlib
import json
import math
import resource
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bench_fixtures import SMALL

from simbench.bench.execute.verify import verify_run
from simbench.bench.map import making, surrogate
from simbench.bench.map.making import map_grid
from simbench.bench.score.scoring import score_run
from simbench.cli import main
from simbench.figures import draw_map
from simbench.scenarios.grid import make_grid
from tests.scenarios.test_sample import MILLION

METHODS = ["he", "yamashita"]
RATES = ("cost", "accuracy", "sensitivity", "false_positives")


def digests(folder):
    """What a map consists of, but for its run."""
    return {
        f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in folder.iterdir() if f.is_file()
    }


def made(grid, folder, **more):
    draw_map(map_grid(grid, folder, 20, METHODS, **more))
    return folder


@pytest.fixture(scope="module", autouse=True)
def few_forests():
    """A few forests are enough where nobody looks at the intervals."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surrogate, "_BAGS", 6)
        yield


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    return made(make_grid(SMALL, "small", {"repeats": 2}), tmp_path_factory.mktemp("map") / "map")


def test_the_files_are_those_of_the_contract(mapped):
    assert {f.name for f in mapped.iterdir()} == {
        "run",
        "map.parquet",
        "map.json",
        "he.svg",
        "yamashita.svg",
    }
    of = json.loads((mapped / "map.json").read_text())
    assert list(of) == METHODS
    for row in of.values():
        assert set(row["cost"]) == {"value", "lo", "hi"}
        assert 0.0 <= row["cost"]["lo"] <= row["cost"]["value"] <= row["cost"]["hi"] <= 1.0
        assert 0 < row["oscillating"]["n"] <= row["n"] <= 20
    table = pd.read_parquet(mapped / "map.parquet")
    axes = ["block", "Td_over_T", "S_over_2J", "noise_ratio", "disturbance", "Td_over_Ti"]
    assert list(table) == [
        "method",
        *axes,
        *(f"{rate}{end}" for rate in RATES for end in ("", "_lo", "_hi")),
    ]
    assert table.groupby("method").size().to_dict() == dict.fromkeys(METHODS, 8)
    # a cell has what its block has of each axis
    grid = make_grid(SMALL, "small", {"repeats": 2})
    for cell, row in enumerate(table[table.method == "he"].to_dict("records")):
        tags = grid.group(cell).drafts[0].tags
        assert all(
            row[a] == tags[a] if a in tags and tags[a] is not None else pd.isna(row[a])
            for a in axes
        )
    known = table.accuracy.notna()
    assert known.any()
    assert (table.accuracy_lo[known] <= table.accuracy[known] + 1e-9).all()


def test_the_sample_is_a_part_of_the_run_of_the_whole_grid(mapped, finished):
    columns = ["scenario_id", "method", "verdict", "score", "verdict_raw", "score_raw"]
    part, whole = (
        pd.read_parquet(f / "verdicts.parquet")[columns] for f in (mapped / "run", finished)
    )
    assert len(part) == 40
    whole = (
        whole.set_index(["scenario_id", "method"])
        .loc[list(zip(part.scenario_id, part.method))]
        .reset_index()
    )
    pd.testing.assert_frame_equal(part, whole)
    assert verify_run(mapped / "run").contradictions == ()


def test_a_map_of_all_scenarios_has_the_costs_of_the_run(small, finished, tmp_path):
    grid_map = map_grid(small, tmp_path / "map", 32, METHODS)
    rows = score_run(finished).as_json()["rows"]
    for name in METHODS:
        for population, of in (
            ("all", grid_map.methods[name]),
            ("oscillating", grid_map.methods[name]["oscillating"]),
        ):
            wanted = {
                "method": name,
                "truth": "cycled",
                "front_end": True,
                "process": "all",
                "population": population,
            }
            (row,) = [r for r in rows if all(r[key] == value for key, value in wanted.items())]
            assert of["cost"]["value"] == pytest.approx(row["cost"], abs=1e-6)
            assert of["n"] == row["applicable"]


def test_a_map_is_not_written_over_and_another_size_is_not_mixed_in(small, mapped):
    before = digests(mapped)
    assert digests(made(small, mapped, resume=True)) == before
    with pytest.raises(Exception, match=r"already holds a run; continue it with --resume"):
        made(small, mapped)
    with pytest.raises(Exception, match=r"cannot be resumed: the grid differs"):
        map_grid(small, mapped, 19, METHODS, resume=True)
    assert digests(mapped) == before


def test_of_a_million_cells_a_random_part_is_in_the_table_and_memory_stays_small(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(making, "_MOST_ROWS", 4000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    grid_map = map_grid(make_grid(MILLION, "million"), tmp_path / "map", 60, ["he"])
    assert len(grid_map.sample.whole) == 1_000_000
    assert 3_900 < len(grid_map.table) <= 4000
    assert grid_map.table["controller.Kc"].nunique() == 100
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024 < 300  # MB


def test_the_command_prints_costs_and_draws_the_axes_asked_for(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["map", "smoke", "-o", "map", "--points", "12", "--method", "he"]
    assert main([*words, "--x", "S_over_2J", "--y", "disturbance"]) == 0
    printed = capsys.readouterr().out
    assert "12 of the 48 scenarios of grid smoke were simulated." in printed
    assert max(map(len, printed.splitlines())) <= 100
    picture = Path("map/he.svg").read_text()
    assert "S_over_2J" in picture
    assert "disturbance" in picture
    assert main([*words, "--resume", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(Path("map/map.json").read_text())


def wrong_grid(tmp_path, axes):
    loop = {**MILLION, "axes": axes, "repeats": 3}
    return make_grid(loop, "one")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": "Td_over_TT"}, "--x Td_over_TT: did you mean 'Td_over_T'"),
        ({"y": "wind"}, "--y wind"),
        ({"x": "block", "y": "block"}, "two different axes are needed"),
        ({"points": 49}, "49 points; 1 to 48 are allowed"),
        ({"points": 0}, "0 points; 1 to 48 are allowed"),
        ({"methods": ["horhc"]}, "horch"),
        ({"backend": "slurm"}, "slurm"),
        ({"out": "s3://bucket/map"}, "folder of this machine"),
    ],
)
def test_what_cannot_be_mapped_is_refused_before_anything_is_written(
    tmp_path, monkeypatch, change, words
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(Exception, match=words):
        map_grid("smoke", **{"out": "map", "points": 12, "methods": ["he"], **change})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("axes", [{}, {"valve.S": [3]}])
def test_a_grid_of_one_loop_has_no_map(tmp_path, axes):
    with pytest.raises(
        Exception, match="grid one has no axis with two values or more; a map needs one"
    ):
        map_grid(wrong_grid(tmp_path, axes), tmp_path / "map", 3, ["he"])


def test_a_map_over_one_axis_is_a_strip(tmp_path):
    grid_map = map_grid(wrong_grid(tmp_path, {"valve.S": [1, 4]}), tmp_path / "map", 6, ["he"])
    draw_map(grid_map)
    assert (*grid_map.axes, len(grid_map.table)) == ("valve.S", None, 2)
    assert all(math.isfinite(v) or np.isnan(v) for v in grid_map.table.cost)


def test_a_cell_without_members_has_no_row(small, tmp_path):
    table = small.content.model_dump()
    for block in table["block"]:
        for member in block["member"]:
            member["where"] = {"disturbance": ["none"]}
    grid_map = map_grid(make_grid(table, "small"), tmp_path / "map", 16, ["he"])
    assert list(grid_map.table.disturbance) == ["none"] * 4

"""The newcomer's pages run as they stand, with fewer loops."""

import json
import re
import runpy
import shlex
from pathlib import Path

import pandas as pd
import pytest

import simbench as sb
from simbench.cli import main
from simbench.scenarios.grid import load_grid

PAGES = Path(__file__).parents[1] / "docs" / "site" / "tutorials"
CELL = re.compile(r"```\{code-cell\} ipython3\n(.*?)```", re.DOTALL)


def cells(page):
    """Return the code of a page's cells without their tags."""
    return [
        re.sub(r"^:tags:.*\n\n", "", body)
        for body in CELL.findall((PAGES / page).read_text(encoding="utf-8"))
    ]


def written(cell):
    name, text = cell.removeprefix("%%writefile ").split("\n", 1)
    Path(name).write_text(text, encoding="utf-8")


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_from_a_second_order_plant_to_a_score_of_200_loops_it_is_forty_lines():
    file, code, table, *_ = cells("own_loop.md")
    written(file)
    assert len(load_grid("second.toml")) == 200
    lines = [line for cell in (file, code, table) for line in cell.splitlines() if line.strip()]
    assert len(lines) <= 40
    scope = {}
    exec(code.replace('out="second"', 'out="second", sets={"repeats": 2}'), scope)
    scores = sb.score(scope["folder"]).ranking()
    assert set(scores.method) >= {"sharp_corners", "horch", "he"}
    verdicts = pd.read_parquet(scope["folder"] / "verdicts.parquet")
    assert (verdicts.method == "sharp_corners").sum() == 8


def test_the_pages_loops_are_simulated_and_predicted():
    scope = {"sb": sb}
    predicted, cascade = (
        c for c in cells("own_loop.md") if c.startswith(("loop = sb.Loop", "cascade"))
    )
    exec(predicted, scope)
    assert scope["loop"].predict()["exact"]["period"] > 0.0
    exec(cascade, scope)
    assert scope["run"].outer.n == 2000


def test_a_grid_is_built_step_by_step():
    steps = cells("own_grid.md")
    scope = {}
    for cell in steps[:3]:
        written(cell) if cell.startswith("%%writefile") else exec(cell, scope)
    assert scope["grid"].group_count == 12
    assert len(load_grid("step.toml")) == 12
    blocks = next(
        cell for cell in steps if "blocks.toml" in cell and cell.startswith("%%writefile")
    )
    written(blocks)
    assert len(load_grid("blocks.toml")) == 16


def test_of_a_grid_of_a_million_cells_a_sample_is_run(capsys):
    file, command, *_ = cells("large_grid.md")
    written(file)
    assert load_grid("million.toml").cells == 1_000_000
    (line,) = command.strip().splitlines()[1:]
    line = line.replace("--n 60", "--n 12").replace(",hammerstein", "")
    assert main(shlex.split(line)[1:]) == 0
    assert "12 scenarios" in capsys.readouterr().out


def test_answers_of_a_program_without_simbench_are_ranked(capsys):
    for cell in cells("other_language.md"):
        if cell.startswith("%%writefile"):
            written(cell)
            assert "simbench" not in Path("squarer.py").read_text(encoding="utf-8")
        elif cell.startswith("%%bash"):
            for line in cell.splitlines()[1:]:
                program, *words = shlex.split(line.partition(" > ")[0])
                if program == "simbench":
                    assert main(words) == 0, line
                elif program == "python":
                    runpy.run_path(words[0])
            printed = capsys.readouterr().out
    assert {
        (r["method"], r["n"]) for r in json.loads(printed)["rows"] if r["truth"] == "sticky"
    } >= {
        ("squarer", 12),
        ("he", 12),
    }

"""What the README shows works as written: the user's own detector goes through detect, run and score."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from detectors.registry import methods
from scenarios.spec import Loop
from simbench.cli import main

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def block(language: str, containing: str) -> str:
    """Return the README's code block of a language that contains some text."""
    blocks = re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)
    (found,) = [b for b in blocks if containing in b]
    return found


@pytest.fixture
def own_detector(tmp_path):
    path = tmp_path / "fullness.py"
    path.write_text(block("python", "METHOD = Method("), encoding="utf-8")
    yield path
    methods._files.pop("fullness", None)


def test_the_loop_file_is_one():
    assert Loop.from_table(tomllib.loads(block("toml", "[plant]"))).valve.name == "choudhury"


def test_a_users_detector_runs_through_detect_run_and_score(tmp_path, own_detector, capsys):
    loop, record, run = tmp_path / "loop.toml", tmp_path / "rec.csv", tmp_path / "run"
    loop.write_text(block("toml", "[plant]"), encoding="utf-8")
    assert main(["simulate", str(loop), "-o", str(record)]) == 0
    capsys.readouterr()
    assert main(["detect", str(record), "--plugin", str(own_detector), "--method", "fullness", "--json"]) == 0
    (verdict,) = json.loads(capsys.readouterr().out)
    assert verdict["method"] == "fullness"
    assert verdict["verdict"] == "stiction"
    assert verdict["indices"]["fuller"] > 0.02
    chosen = ["--plugin", str(own_detector), "--method", "fullness,horch"]
    assert main(["run", "smoke", "-o", str(run), *chosen]) == 0
    assert main(["score", str(run), "--json"]) == 0
    assert "fullness" in capsys.readouterr().out
    # and as a worker in another process, which has to find the file again
    assert main(["run", "smoke", "-o", str(tmp_path / "two"), "-j", "2", *chosen]) == 0


def test_the_users_detector_keeps_its_contract(own_detector, capsys):
    assert main(["contract", str(own_detector)]) == 0
    assert capsys.readouterr().out.strip() == "detector fullness: keeps its contract"


def test_the_detector_takes_about_thirty_lines():
    assert len(block("python", "METHOD = Method(").strip().splitlines()) <= 30


def test_the_sweep_gives_a_score_table(tmp_path, monkeypatch):
    (tmp_path / "loop.toml").write_text(block("toml", "[plant]").replace("Ts = 1.0", "Ts = 1.0\nn = 600"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    exec(block("python", "sb.sweep"), scope)
    assert {"horch", "he"} <= set(scope["scores"].astype(str).to_numpy().ravel()) | set(map(str, scope["scores"].index))

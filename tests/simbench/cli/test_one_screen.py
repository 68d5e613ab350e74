"""What a verb prints by default fits one screen: at most 30 lines of at most 100 columns."""

import shutil
from pathlib import Path

import pytest

from simbench.cli import main

EXAMPLE = Path(__file__).parents[3] / "docs" / "example"
MODEL = EXAMPLE / "model.toml"
LINES, COLUMNS = 30, 100
PATHS = ("page: ", "table: ", "run: ")  # begin a line that is as long as its path
COMMANDS = {
    "detect": ["detect", "rec.csv"],
    "detect a folder": ["detect", "records"],
    "diagnose": ["diagnose", "rec.csv"],
    "gap diagnose": ["gap", "diagnose", "rec.csv", "--baseline", MODEL],
    "run": ["run", "smoke", "-o", "run", "--method", "horch,he", "--resume"],
    "score": ["score", "run"],
    "run --add": ["run", "run", "--add", "--method", "yamashita", "-o", "more"],
    "run beside the shipped": [
        *("run", "ci", "--n", "60", "-o", "beside", "--method", "horch", "--with-reference"),
    ],
}
BEFORE = {
    "score": [["run", "smoke", "-o", "run", "--method", "horch,he", "--resume"]],
    "run --add": [["run", "smoke", "-o", "run", "--method", "horch,he", "--resume"]],
    "run beside the shipped": [],
}


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Return a folder with the documentation's example as a record and as a folder of records."""
    place = tmp_path_factory.mktemp("screen")
    assert main(["simulate", str(EXAMPLE / "loop.toml"), "-o", str(place / "rec.csv")]) == 0
    (place / "records").mkdir()
    shutil.copy(place / "rec.csv", place / "records" / "FIC-101.csv")
    return place


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_verb_prints_fits_one_screen(records, name, monkeypatch, capsys):
    monkeypatch.chdir(records)
    for words in BEFORE.get(name, []):
        assert main(words) == 0
    capsys.readouterr()
    assert main([str(word) for word in COMMANDS[name]]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert 0 < len(lines) <= LINES
    assert max(len(line) for line in lines if not line.startswith(PATHS)) <= COLUMNS

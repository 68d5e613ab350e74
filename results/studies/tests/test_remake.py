"""Results are what listed commands print: every file has a row, and a failing command is named."""

from __future__ import annotations

import subprocess
from pathlib import Path

from results.studies import remake

ROOT = Path(__file__).parents[3]
TABLE = remake.listed((ROOT / "results" / "README.md").read_text(encoding="utf-8"))


def test_every_kept_file_has_a_row():
    kept = subprocess.run(
        ["git", "ls-files", "results"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    results = [
        k.removeprefix("results/")
        for k in kept
        if not k.startswith("results/studies/") and not k.endswith(("README.md", remake.PRINTED))
    ]
    rows = [name for name in TABLE if name.endswith("/")]
    assert len(results) > 50
    assert [
        r for r in results if r not in TABLE and not any(r.startswith(folder) for folder in rows)
    ] == []


def test_a_failing_command_is_named_and_ends_its_row(tmp_path, monkeypatch, capfd):
    (tmp_path / "results").mkdir()
    text = "| `a.txt` | `false`, `touch never` |\n| `b.txt` | `echo seen > b.txt` |\n"
    (tmp_path / "results" / "README.md").write_text(text)
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    assert remake.main([]) == 1
    assert (tmp_path / "b.txt").read_text() == "seen\n"
    assert not (tmp_path / "never").exists()
    assert "failed: a.txt" in capfd.readouterr().err


def test_a_failing_command_leaves_the_file_that_was_there(tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "README.md").write_text("| `a.txt` | `false > results/a.txt` |\n")
    (tmp_path / "results" / "a.txt").write_text("kept\n")
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    assert remake.main([]) == 1
    assert (tmp_path / "results" / "a.txt").read_text() == "kept\n"


def test_a_fault_of_a_study_is_no_verdict():
    # without exit_code an exception ends with 1, as a missed bar does
    starts = [
        path
        for path in (ROOT / "results" / "studies").rglob("*.py")
        if "tests" not in path.parts and '\nif __name__ == "__main__":' in path.read_text("utf-8")
    ]
    assert len(starts) > 30
    assert [path.name for path in starts if "exit_code(" not in path.read_text("utf-8")] == []

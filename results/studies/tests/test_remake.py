"""Results are what listed commands print: every file has a row, every command exists, and a failing
one is named.
"""

from __future__ import annotations

import importlib.util
import shlex
import subprocess
from pathlib import Path

import pytest

from results.studies import remake
from results.studies.stale import LastRun
from simbench.usage import exit_code

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


@pytest.mark.parametrize("name", TABLE)
def test_a_row_names_commands_that_exist(name):
    assert TABLE[name]
    for command in TABLE[name]:
        words = shlex.split(command.split(">")[0])
        assert words[0] in ("simbench", "python", "make", "cp", "awk"), command
        # a command that names what stands for a folder or a file is an explanation
        assert not [word for word in words if word.isupper() and len(word) > 1], command
        if words[:2] == ["python", "-m"]:
            assert importlib.util.find_spec(words[2]), command
        elif words[0] == "python":
            assert (ROOT / words[1]).exists(), command
        elif words[0] == "awk":
            assert (ROOT / words[2]).exists(), command


def test_a_failing_command_is_named_and_ends_its_row(tmp_path, monkeypatch, capfd):
    (tmp_path / "results").mkdir()
    text = "| `a.txt` | `false`, `touch never` |\n| `b.txt` | `echo seen > b.txt` |\n"
    (tmp_path / "results" / "README.md").write_text(text)
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    assert remake.main([]) == 1
    assert (tmp_path / "b.txt").read_text() == "seen\n"
    assert not (tmp_path / "never").exists()
    assert "failed: a.txt" in capfd.readouterr().err


def test_an_unknown_row_is_answered_with_the_nearest(capsys):
    assert exit_code(lambda: remake.main(["gat.txt"])) == 2
    assert "gate.txt" in capsys.readouterr().err


def test_a_failing_command_leaves_the_file_that_was_there(tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "README.md").write_text("| `a.txt` | `false > results/a.txt` |\n")
    (tmp_path / "results" / "a.txt").write_text("kept\n")
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    assert remake.main([]) == 1
    assert (tmp_path / "results" / "a.txt").read_text() == "kept\n"


def test_what_a_row_took_is_kept_for_the_list_of_stale_results(tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    text = "| `a.txt` | `sleep .1` |\n| `b.txt` | `false` |\n"
    (tmp_path / "results" / "README.md").write_text(text)
    (tmp_path / "results" / "printed.toml").write_text(
        '"a.txt" = { commit = "abc", minutes = 9.0 }\n"c/" = { commit = "def", minutes = 2.5 }\n'
    )
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    remake.main([])
    # outside a git checkout no commit is known
    kept = {"a.txt": LastRun("", 0.0), "c/": LastRun("def", 2.5)}
    assert remake.last_runs(tmp_path) == kept
    remake.main(["a.txt", "--list"])
    assert remake.last_runs(tmp_path) == kept


def test_a_study_that_prints_that_a_bar_is_missed_has_printed(tmp_path, monkeypatch, capfd):
    (tmp_path / "results").mkdir()
    (tmp_path / "wrong.py").write_text("(")
    says_no = "python -m compileall wrong.py > results/a.txt"  # ends with 1 and prints
    (tmp_path / "results" / "README.md").write_text(f"| `a.txt` | `{says_no}` |\n")
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    assert remake.main([]) == 0
    assert "a.txt: printed; it falls short of a bar" in capfd.readouterr().out


def test_a_fault_of_a_study_is_no_verdict():
    # without exit_code an exception ends with 1, as a missed bar does
    starts = [
        path
        for path in (ROOT / "results" / "studies").rglob("*.py")
        if "tests" not in path.parts and '\nif __name__ == "__main__":' in path.read_text("utf-8")
    ]
    assert len(starts) > 30
    assert [path.name for path in starts if "exit_code(" not in path.read_text("utf-8")] == []

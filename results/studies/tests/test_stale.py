"""A result is stale once code that its study depends on has changed."""

from __future__ import annotations

import subprocess

import grimp
import pytest

from results.studies import stale

GRAPH = grimp.build_graph("simbench", "results")


@pytest.mark.parametrize(
    ("command", "files"),
    [
        (
            "python -m results.studies.gate runs/ci > results/gate.txt",
            {"results/studies/gate.py", "simbench/bench/check/check.py"},
        ),
        # found by name: no import says so
        ("simbench run ci -o runs/ci", {"detectors/methods/he.py", "simbench/loop/valves/kano.py"}),
        (
            "python -m results.studies.plant.influence ../shared/data/isdb",
            {"simbench/gap/effects/drift.py", "simbench/gap/stiction/conclusion.py"},
        ),
    ],
)
def test_code_that_a_command_depends_on_is_found(command, files):
    assert files <= stale.code_of([command], GRAPH)


def test_what_a_command_does_not_use_makes_no_result_stale():
    code = stale.code_of(["python -m results.studies.gate runs/ci"], GRAPH)
    assert "simbench/gap/diagnosis.py" not in code


def test_a_result_is_stale_from_the_next_change_of_its_code_on(tmp_path):
    def git(*words):
        about = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
        subprocess.run(["git", *about, *words], cwd=tmp_path, check=True, capture_output=True)

    for folder in ("results", "simbench"):
        (tmp_path / folder).mkdir()
    (tmp_path / "results" / "a.txt").write_text("1\n")
    code = tmp_path / "simbench" / "x.py"
    code.write_text("1\n")
    git("init")
    git("add", "-A")
    git("commit", "-m", "first")
    used = {"simbench/x.py", "simbench/y.py"}
    fresh = stale._look_up(tmp_path, "a.txt", used)
    assert (fresh.files, fresh.changed) == (1, 0)
    code.write_text("1\n2\n")
    old = stale._look_up(tmp_path, "a.txt", used)
    assert (old.changed, old.lines) == (1, 1)
    assert str(old).endswith("of 1 files of code 1 have changed since, by 1 lines")
    git("commit", "-am", "second")
    # it was printed again at this commit, with the same bytes
    head = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout.strip()
    assert stale._look_up(tmp_path, "a.txt", used, stale.LastRun(head, 2.0)).changed == 0
    code.write_text("1\n2\n3\n")
    for lost in ("", "0123456789ab"):  # unknown, or not in a shallow checkout
        assert stale._look_up(tmp_path, "a.txt", used, stale.LastRun(lost, 2.0)).lines == 2
    again = stale._look_up(tmp_path, "a.txt", used, stale.LastRun(head, 2.0))
    assert str(again).endswith("by 1 lines; takes 2.0 minutes")
    assert str(stale._look_up(tmp_path, "b.txt", used)) == "b.txt: not committed"

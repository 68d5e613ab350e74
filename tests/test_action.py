"""The composite action: every step that is a script runs in bash as GitHub would run it."""

from __future__ import annotations

import copy
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from simbench.cli import main

ROOT = Path(__file__).parents[1]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = {step["name"]: step for step in ACTION["runs"]["steps"] if "run" in step}
INSTALL, ASK, COMPARE, COMMENT = STEPS
PLUGIN = '''"""Fuller: a sticky valve makes PV squarer than OP."""
import numpy as np
from simbench.detectors.method import Method
from simbench.detectors.verdict import NO_STICTION, STICTION, Verdict

METHOD = Method("fuller", source="test", process=("self-regulating", "integrating"))

def detect(prepared):
    """Compare mean |x| over rms of PV and OP."""
    pv, op = (np.abs(x).mean() / x.std() for x in map(prepared.clean, ("pv", "op")))
    verdict = STICTION if pv > op + 0.02 else NO_STICTION
    return Verdict("fuller", verdict, pv - op, reason="fuller")
'''
# notes its words, lists the comments that `comments.txt` names, and fails where a fork's token does
GH = """#!/bin/sh
printf "%s\\n" "$@" > "$RUNNER_TEMP/gh.txt"
case "$*" in *--paginate*) cat "$RUNNER_TEMP/comments.txt" 2> /dev/null; exit 0;; esac
[ ! -f "$RUNNER_TEMP/fork" ]
"""


@pytest.fixture(scope="module")
def baseline(tmp_path_factory):
    """A repository with a detector and its baseline."""
    place = tmp_path_factory.mktemp("repository")
    (place / "fuller.py").write_text(PLUGIN)
    words = ["--plugin", str(place / "fuller.py"), "--method", "fuller"]
    assert main(["run", "ci", "--n", "48", "-o", str(place / "first"), *words]) == 0
    kept = ["--against", str(place / "kept"), "--update"]
    assert main(["check", str(place / "first"), *kept]) == 0
    return place


class Job:
    """A job of GitHub: its folders, its variables, and the inputs of the action."""

    def __init__(self, folder: Path, repository: Path, **inputs: str) -> None:
        self.temp, self.repository = folder, repository
        self.inputs = {name: about.get("default", "") for name, about in ACTION["inputs"].items()}
        self.inputs |= {name.replace("_", "-"): value for name, value in inputs.items()}
        self.inputs["jobs"] = "1"  # workers take longer to begin than these loops to judge
        (folder / "bin").mkdir()
        (folder / "bin" / "gh").write_text(GH)
        (folder / "bin" / "gh").chmod(0o755)

    def copied(self, folder: Path) -> Job:
        """The same job, with all that it has written so far, in another folder."""
        other = copy.copy(self)
        other.temp, other.inputs = folder, dict(self.inputs)
        shutil.copytree(self.temp, folder, dirs_exist_ok=True)
        return other

    def step(self, name: str) -> int:
        """Run a step, and return its exit code."""
        given = {key: self._filled(text) for key, text in STEPS[name].get("env", {}).items()}
        path = [self.temp / "bin", Path(sys.executable).parent, os.environ["PATH"]]
        files = {
            "GITHUB_OUTPUT": str(self.temp / "output.txt"),
            "GITHUB_STEP_SUMMARY": str(self.temp / "summary_of_the_job.md"),
            "RUNNER_TEMP": str(self.temp),
            "PATH": os.pathsep.join(map(str, path)),
        }
        script = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", STEPS[name]["run"]]
        environment = {**os.environ, **files, **given}
        return subprocess.run(script, env=environment, cwd=self.repository, check=False).returncode

    def _filled(self, text: str) -> str:
        known = {f"inputs.{name}": value for name, value in self.inputs.items()}
        known |= {"github.token": "secret", "github.repository": "we/ours"}
        known["github.event.pull_request.number"] = "7"
        return re.sub(r"\$\{\{ (\S+) \}\}", lambda found: known[found[1]], text)

    def result(self) -> str:
        """Return what the action hands on."""
        return (self.temp / "output.txt").read_text().strip()


@pytest.fixture(scope="module")
def asked(baseline, tmp_path_factory):
    """A job whose run is done, never to be changed."""
    asks = {"plugin": "fuller.py", "method": "fuller", "with_reference": "true"}
    job = Job(tmp_path_factory.mktemp("job"), baseline, baseline="kept", **asks)
    assert job.step(ASK) == 0
    return job


def test_a_run_without_loss_passes_and_its_table_is_a_comment(asked, tmp_path):
    job = asked.copied(tmp_path)
    code = job.step(COMPARE)
    assert (code, job.result()) in ((0, "result=same"), (3, "result=cannot tell"))
    summary = (tmp_path / "summary_of_the_job.md").read_text()
    assert summary.startswith("### Detector check: ")
    assert re.search(r"^\| +\| \d+=? +\| fuller ", summary, re.MULTILINE)
    assert "procedure" in summary
    assert re.search(r"benchmark ci-\d", summary)
    assert job.step(COMMENT) == 0
    words = (tmp_path / "gh.txt").read_text().splitlines()
    assert words[:3] == ["pr", "comment", "7"]
    assert Path(words[-1]).read_text() == f"<!-- simbench check -->\n{summary}"

    # the second time the comment that has the mark is changed
    (tmp_path / "comments.txt").write_text("41\n")
    assert job.step(COMMENT) == 0
    words = (tmp_path / "gh.txt").read_text().splitlines()
    assert words[:4] == ["api", "--method", "PATCH", "repos/we/ours/issues/comments/41"]

    # a fork's token may not write
    (tmp_path / "fork").touch()
    assert job.step(COMMENT) == 0


def test_a_detector_that_became_worse_fails_the_job(baseline, tmp_path):
    (baseline / "worse").mkdir(exist_ok=True)
    worse = baseline / "worse" / "fuller.py"
    worse.write_text(PLUGIN.replace("pv > op + 0.02", "pv < op + 0.02"))
    job = Job(tmp_path, baseline, baseline="kept", plugin="worse/fuller.py", method="fuller")
    assert job.step(ASK) == 0
    assert job.step(COMPARE) == 1
    assert job.result() == "result=worse"
    assert "### Detector check: worse" in (tmp_path / "summary.md").read_text()
    assert job.step(COMMENT) == 0


def test_what_cannot_be_compared_is_said(asked, tmp_path):
    job = asked.copied(tmp_path)
    job.inputs["baseline"] = "nowhere"
    assert job.step(COMPARE) == 2
    assert job.result() == "result=not comparable"
    assert (tmp_path / "summary.md").read_text().startswith("### Detector check: not comparable")


def test_without_a_run_no_comment_is_written(baseline, tmp_path):
    job = Job(tmp_path, baseline, baseline="nowhere")
    assert job.step(ASK) == 2
    assert job.step(COMMENT) == 0
    assert not (tmp_path / "gh.txt").exists()

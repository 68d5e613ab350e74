"""The host of third-party plug-ins: what one may not touch, what it starts, what it says, and what it may remember."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from detectors.detection import detect
from detectors.errors import ParameterError
from detectors.plugins.host import cleaned
from detectors.plugins.registry import methods
from detectors.record import LoopRecord

FILE = """
import ctypes, os, socket, subprocess, sys, time
from pathlib import Path
from detectors.method import Method
from detectors.verdict import Verdict
METHOD = Method(title="mine", source="nobody", front_end=False)
calls = []
HOUSE = Path(sys.modules["detectors"].__file__).parents[1]
def say(reason, score=0.0, **more):
    return Verdict("x", "stiction", score=score, reason=str(reason), **more)
def detect(prepared):
    {body}
"""
T = np.arange(600.0)
RECORD = LoopRecord(op=50 + np.sin(T / 8), pv=50 - np.sin(T / 8 - 1), Ts=1.0)


@pytest.fixture
def ask(tmp_path):
    """Return the verdicts that a plug-in with this body gives on records asked one after the other."""

    def asked(body: str, times: int = 1, seconds: float = 20.0) -> list:
        file = tmp_path / "mine.py"
        file.write_text(FILE.format(body=body))
        methods.add_hosted(file, seconds)
        return [detect(RECORD, ["mine"])["mine"] for _ in range(times)]

    yield asked
    methods.forget("mine")


def leaves(pid: Path) -> str:
    """Start a process that no Python event tells of, in a session of its own, whose parent is gone."""
    return f"""c = ctypes.CDLL(None)
    if c.fork() == 0:
        c.setsid()
        if c.fork() == 0:
            open({str(pid)!r}, "w").write(str(c.getpid()))
            time.sleep(1000)
        os._exit(0)
    while not os.path.exists({str(pid)!r}): time.sleep(.01)
    return say("fine")"""


WALLS = {
    "reads a command line": 'open(f"/proc/{os.getppid()}/cmdline")',
    "looks by another way": 'os.symlink("/proc", "p"); open("p/1/cmdline")',
    "lists processes": 'os.listdir("/proc")',
    "starts a process": 'subprocess.run(["true"])',
    "starts a shell": 'os.system("true")',
    "forks": "os.fork()",
    "ends its parent": "os.kill(os.getppid(), 9)",
    "asks the network": 'socket.create_connection(("127.0.0.1", 9))',
    "imports grids": "import scenarios.grid",
    "imports the benchmark": "from simbench.bench.execute import run",
    "reads a grid": 'open(HOUSE / "scenarios/grids/smoke.toml")',
    "reads labels": 'open(HOUSE / "results/baseline/scenarios.parquet", "rb")',
    "runs the simulator's text": 'exec(open(HOUSE / "simbench/loop/run.py").read())',
    "writes elsewhere": 'open({outside!r}, "w")',
    "makes a folder": "os.mkdir({outside!r})",
    "moves itself": "os.rename(__file__, {outside!r})",
}


@pytest.mark.parametrize("name", WALLS)
def test_what_a_plug_in_may_not_touch_is_refused_in_a_sentence(ask, tmp_path, name):
    outside = tmp_path.parent / f"{tmp_path.name}-outside"
    verdict = ask(WALLS[name].replace("{outside!r}", repr(str(outside))))[0]
    assert verdict.verdict == "no_decision"
    assert "a plug-in may not" in verdict.reason
    assert not outside.exists()


def test_it_writes_beside_its_file_and_into_a_folder_that_goes_with_it(ask, tmp_path):
    verdict = ask('Path("a").write_text("b"); (Path(__file__).parent / "c").write_text("d"); return say(os.getcwd())')[0]
    assert (tmp_path / "c").read_text() == "d"
    folder = Path(verdict.reason.partition(";")[0])
    assert folder != Path.cwd()
    methods.forget("mine")
    assert not folder.exists()


def test_it_is_told_nothing_of_the_run(ask, tmp_path, monkeypatch):
    (tmp_path / "secret-run").mkdir()
    monkeypatch.chdir(tmp_path / "secret-run")
    monkeypatch.setenv("PWD", str(tmp_path / "secret-run"))
    verdict = ask("return say([sys.argv, sys.orig_argv, os.getcwd(), dict(os.environ), os.getppid()])")[0]
    assert str(os.getpid()) not in verdict.reason
    assert "secret-run" not in verdict.reason


def test_it_remembers_no_question(ask):
    scores = [v.score for v in ask('calls.append(1); return say("counted", len(calls))', times=3)]
    assert len(set(scores)) == 1


def test_what_it_starts_unseen_is_ended_and_named(ask, tmp_path):
    verdict = ask(leaves(tmp_path / "pid"))[0]
    assert "process" in verdict.reason
    assert "behind" in verdict.reason
    child, until = int((tmp_path / "pid").read_text()), time.monotonic() + 5.0
    while Path(f"/proc/{child}").exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not Path(f"/proc/{child}").exists()


SAYINGS = {
    "a lone surrogate": 'raise ValueError("\\ud800")',
    "escape sequences": 'raise ValueError("\\x1b[31mred\\x1b]0;title\\x07")',
    "in a reason": 'return say("a\\ud800\\x1b[2J\\r\\nb")',
    "in an index": 'return say("x", indices={"i\\ud800\\n": 1.0})',
}


@pytest.mark.parametrize("name", SAYINGS)
def test_its_text_is_one_line_that_everything_can_show(ask, name):
    verdict = ask(SAYINGS[name])[0]
    for text in (verdict.reason, *verdict.indices):
        assert text.isprintable()
        text.encode()


def test_lines_and_controls_become_spaces():
    assert cleaned("a\r\n\tb\x00\u202e") == "a b??"


def test_a_detector_that_is_a_number_is_refused(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(FILE.format(body="pass") + "\ndetect = 3\n")
    with pytest.raises(ParameterError, match="detect = 3 is no function"):
        methods.add_hosted(file)

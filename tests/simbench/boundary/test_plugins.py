"""Plug-ins that misbehave: whatever one does by mistake, every other verdict is bit-equal, and the
offender is named.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from simbench.detectors.plugins.registry import methods
from simbench.detectors.record import LoopRecord
from simbench.verbs import detect
from tests.simbench.boundary.conftest import answer_to, refused, sampled
from tests.simbench.boundary.test_records import csv

HEAD = """
import os, sys, time, json
import numpy as np
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="a stranger", source="nobody", front_end=False)
seen = []
def detect(prepared, **thresholds):
    {body}
"""
# right when first asked, as the example record is: what is wrong from the start is refused before
# anything is judged
LATER = "seen.append(1)\n    if len(seen) > 1: return "
FINE = 'return Verdict("x", "stiction", score=1.0, reason="because")'
# what it does: body of `detect`, and a word of the reason that names it
HOSTILE = {
    "raises": ('raise ValueError("on purpose")', "on purpose"),
    "raises without text": ("raise KeyError", "KeyError"),
    "exits": ("sys.exit(0)", "SystemExit"),
    "nests without end": ("f = lambda: f()\n    return f()", "RecursionError"),
    "returns nothing": (LATER + "None\n    " + FINE, "answers None"),
    "returns a word": (LATER + '"stiction"\n    ' + FINE, "answers 'stiction'"),
    "returns a dict": (LATER + 'dict(verdict="stiction")\n    ' + FINE, "answers {'verdict'"),
    "unknown word": ('return Verdict("x", "sticky", reason="r")', "sticky"),
    "no reason": ('return Verdict("x", "stiction")', "reason"),
    "blank reason": ('return Verdict("x", "stiction", 1.0, reason="  ")', "reason"),
    "word as score": ('return Verdict("x", "stiction", score="high", reason="r")', "score"),
    "no number as score": (
        'return Verdict("x", "stiction", score=float("nan"), reason="r")',
        "score nan",
    ),
    "infinite score": ('return Verdict("x", "no_decision", score=float("inf"), reason="r")', "inf"),
    "infinite index": (
        'return Verdict("x", "stiction", 1.0, {"a": -float("inf")}, reason="r")',
        "index a = -inf",
    ),
    "list as score": ('return Verdict("x", "stiction", score=[1.0], reason="r")', "score"),
    "array as index": (
        'return Verdict("x", "stiction", 1.0, indices={"a": np.ones(3)}, reason="r")',
        "a",
    ),
    "object as index": (
        'return Verdict("x", "stiction", 1.0, indices={"a": object()}, reason="r")',
        "indices",
    ),
    "indices no table": (
        'return Verdict("x", "stiction", 1.0, indices=[1], reason="r")',
        "indices",
    ),
    "word as S": ('return Verdict("x", "stiction", 1.0, S="5", reason="r")', "S"),
    "infinite S": ('return Verdict("x", "stiction", 1.0, S=float("inf"), reason="r")', "S"),
    "three ends": ('return Verdict("x", "stiction", 1.0, J=(1.0, 2.0, 3.0), reason="r")', "J"),
    "perhaps applicable": (
        'return Verdict("x", "stiction", 1.0, applicable="maybe", reason="r")',
        "",
    ),
    "writes into its input": ("prepared.record.op[0] = 1e9\n    " + FINE, "read-only"),
}
T = np.arange(600.0)
RECORD = LoopRecord(op=50 + np.sin(T / 8), pv=50 - np.sin(T / 8 - 1), Ts=1.0)
OTHERS = ["horch", "horch_histogram", "rossi_scali"]


def plugin(folder: Path, body: str, name: str = "stranger", first: str = "") -> Path:
    """Write a plug-in with the body of its `detect`."""
    file = folder / f"{name}.py"
    file.write_text(first + HEAD.format(body=body))
    return file


@pytest.fixture(autouse=True)
def record_file(here):
    (here / "rec.csv").write_text(csv())


@pytest.fixture(autouse=True)
def forgotten():
    before = set(methods.names())
    yield
    for name in set(methods.names()) - before:
        methods.forget(name)


def answers(names=(), plugins=()) -> tuple[list[dict], dict]:
    """What the built-in detectors answer among others, as JSON, and the others' verdicts."""
    verdicts = {v.method: v for _, v in detect(RECORD, [*names, *OTHERS], plugins=plugins).verdicts}
    return [verdicts.pop(name).as_json() for name in OTHERS], verdicts


@pytest.fixture(scope="module")
def alone() -> list[dict]:
    return answers()[0]


def test_hostile_plug_ins_are_named_and_the_others_do_not_notice(here, alone):
    parts = {"_".join(["x", *name.lower().split()]): HOSTILE[name] for name in HOSTILE}
    methods.add_files(*(plugin(here, body, name) for name, (body, _) in parts.items()))
    others, offenders = answers(parts)
    assert others == alone
    for name, offender in offenders.items():
        assert offender.verdict == "no_decision", name
        assert offender.reason.startswith("failed: ")
        assert parts[name][1] in offender.reason


@pytest.mark.parametrize(
    "words",
    [
        "detect rec.csv",
        pytest.param("run smoke -o run -j 2", marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_names_the_detector_and_the_record(here, words):
    """A detector that never ends holds the command, and Ctrl-C says which it is."""
    number = here / "began"
    hang = f"open({str(number)!r}, 'w').close(); time.sleep(1000)"
    plugin(here, f"seen.append(1)\n    if len(seen) > 1: {hang}\n    {FINE}")
    command = [sys.executable, "-m", "simbench.cli", *words.split(), "--method", "horch"]
    child = subprocess.Popen(
        [*command, "--plugin", "stranger.py"], stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        # a shell that runs the tests in the background ignores Ctrl-C, and its children do
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    until = time.monotonic() + 60.0
    while not number.exists():
        assert time.monotonic() < until
        time.sleep(0.1)
    os.killpg(child.pid, signal.SIGINT)
    _, said = child.communicate(timeout=30)
    assert child.returncode == 130
    about = "rec" if words.startswith("detect") else "scenario "
    assert f"interrupted while stranger judged {about}" in said


METHOD = "from simbench.detectors.method import Method\nMETHOD = Method({})\ndef detect(p): pass"
IMPORTS = [
    ("def (", "SyntaxError"),
    ("import sys; sys.exit(0)", "SystemExit"),
    ("1 / 0", "ZeroDivisionError"),
    ("x = 1", "METHOD"),
    ('METHOD = "m"\ndef detect(p): pass', "METHOD"),
    (METHOD.format('title=3, source="s"'), "title"),
    (METHOD.format('title="t", source="s", process=()'), "process"),
    ("\0\0\0", "null"),
    ("import a_module_nobody_has", "a_module_nobody_has"),
]


@pytest.mark.parametrize(("text", "part"), sampled(IMPORTS, 3))
def test_a_file_that_is_no_plug_in(here, text, part):
    (here / "mine.py").write_text(text)
    refused("detect rec.csv --method horch --plugin mine.py", "mine.py", part)


@pytest.mark.parametrize("words", ["detect rec.csv", "run smoke -o run"])
def test_a_name_that_means_something_already_is_refused(here, words):
    taken = ["oracle", "all", "fast", "full", "horch", "procedure", "always_no"]
    for name in [*taken, "Mine", "my-file", "1st", "a b"]:
        plugin(here, FINE, name)
        refused([*words.split(), "--method", "horch", "--plugin", f"{name}.py"], name, "rename")


def test_a_run_with_an_offender_is_the_run_without_it_for_all_others(here):
    """The verdicts of the others equal, its failures counted, exit 1: it failed on more records
    than allowed.
    """
    plugin(here, "raise ValueError('on purpose')")
    words = (
        "run smoke --set disturbance=none --set Td_over_T=0.3 --set S_over_2J=0.5"
        " --set Td_over_Ti=0.05 --method horch -o"
    )
    answer_to(f"{words} without")
    failed = json.loads(answer_to(f"{words} with --plugin stranger.py --json", 1))["failed"]
    # it is asked about the records that its source covers and that are fit to be judged
    assert list(failed["methods"]) == ["stranger"]
    assert 0 < failed["methods"]["stranger"] <= failed["of"]
    one, two = (
        pd.read_parquet(here / run / "verdicts.parquet").drop(columns="runtime_s")
        for run in ("without", "with")
    )
    pd.testing.assert_frame_equal(
        one, two[two.method == "horch"].reset_index(drop=True), check_exact=True
    )


@pytest.fixture
def published(here, monkeypatch):
    """Publish detectors as an installed distribution does: (name, body of `detect`) of each."""

    def publish(first: str = "", **bodies: str) -> None:
        about = here / "strangers-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 1.0\n")
        lines = "".join(f"{name} = of_a_stranger_{name}\n" for name in bodies)
        (about / "entry_points.txt").write_text(f"[simbench.detectors]\n{lines}")
        for name, body in bodies.items():
            plugin(here, body, f"of_a_stranger_{name}", first)
        monkeypatch.syspath_prepend(here)
        monkeypatch.setenv("PYTHONPATH", str(here))
        methods.__dict__.pop("_entry_points", None)

    yield publish
    monkeypatch.undo()  # or asking for the names would publish them again
    for name in set(methods.__dict__.pop("_entry_points", {})):
        methods.forget(name)


def test_a_published_detector_is_asked_as_those_of_files_are(published, alone):
    published(good=FINE, mad=HOSTILE["raises"][0])
    others, offenders = answers(["mad", "good", "good@published"])
    assert others == alone
    assert offenders["good"].verdict == offenders["good@published"].verdict == "stiction"
    assert "on purpose" in offenders["mad"].reason


def test_a_published_detector_that_cannot_be_imported_is_named_with_its_distribution(published):
    published("raise OSError('no licence')\n", broken=FINE)
    refused("detect rec.csv --method broken", "broken", "strangers", "no licence")

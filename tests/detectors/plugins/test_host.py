"""The worker process of a plug-in: its folders, its limits, what it says, and how it is restarted
and stopped.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simbench.detection import detect
from simbench.detectors.compiled import cache_folder
from simbench.detectors.errors import AnswerError, ParameterError
from simbench.detectors.judge import judge
from simbench.detectors.plugins.host import STRIKES, cleaned
from simbench.detectors.plugins.registry import methods
from simbench.detectors.record import LoopRecord

FILE = """
import os, sys, tempfile
from pathlib import Path
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="mine", source="nobody", front_end=False)
calls = []
def say(reason, score=0.0, **more):
    return Verdict("x", "stiction", score=score, reason=str(reason), **more)
def detect(prepared):
    {body}
"""
T = np.arange(600.0)
RECORD = LoopRecord(op=50 + np.sin(T / 8), pv=50 - np.sin(T / 8 - 1), Ts=1.0)
ROOT = Path(__file__).parents[3]


@pytest.fixture
def ask(tmp_path):
    """Return the verdicts that a plug-in with this body gives on records asked one after the
    other.
    """

    def asked(body: str, times: int = 1, seconds: float = 20.0) -> list:
        file = tmp_path / "mine.py"
        file.write_text(FILE.format(body=body))
        methods.add_hosted(file, seconds=seconds)
        return [detect(RECORD, ["mine"])["mine"] for _ in range(times)]

    yield asked
    methods.forget("mine")


def test_its_folders_are_private_and_the_temporary_one_goes_with_it(ask):
    named = "[os.environ[k] for k in ('HOME', 'XDG_CACHE_HOME', 'NUMBA_CACHE_DIR')]"
    folders = f"[os.getcwd(), tempfile.gettempdir(), *{named}, str(cache_folder())]"
    known = "from simbench.detectors.compiled import cache_folder"
    verdict = ask(f"{known}; return say('|'.join({folders}))")[0]
    here, temporary, home, *caches = verdict.reason.partition(";")[0].split("|")
    assert here == temporary == home != os.environ.get("HOME")
    assert Path(here).is_dir()
    assert all(
        Path(cache).is_relative_to(cache_folder() / "plugins" / "detector-mine") for cache in caches
    )
    methods.forget("mine")
    assert not Path(here).exists()


def test_a_crash_costs_one_verdict_and_the_next_question_finds_a_new_worker(ask, tmp_path):
    gone = (
        f"mark = Path({str(tmp_path / 'mark')!r})\n    calls.append(1)\n    if len(calls) == 3 and"
        " not mark.exists():"
    )
    verdicts = ask(f"{gone} mark.touch(); os._exit(3)\n    return say('here', len(calls))", times=4)
    reasons = [v.reason.partition(";")[0] for v in verdicts]
    assert reasons == ["here", "failed: ended its process (exit status 3)", "here", "here"]
    # the first answer was to the example record
    assert [v.score for v in verdicts if v.score == v.score] == [2.0, 1.0, 2.0]


def test_a_plug_in_that_goes_on_losing_its_worker_is_asked_no_more(ask):
    ask("os._exit(3)", times=0)
    reasons = [judge(RECORD, ["mine"])[0].reason for _ in range(STRIKES + 1)]
    assert "exit status 3" in reasons[0]
    assert f"lost {STRIKES} times" in reasons[-1]


@pytest.fixture
def ctrl_c():
    """Make Ctrl-C raise: a process that was started in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupted_question_leaves_no_answer_for_the_next(ask, ctrl_c):
    ask(
        "import time; time.sleep(6.0 * (prepared.record.op[0] < 90)); return say('x',"
        " prepared.record.op[0])",
        times=0,
    )
    # what is imported, compiled and started here first must not be interrupted
    judge(replace(RECORD, op=RECORD.op + 45), ["horch", "mine"])
    # a signal to this very thread ends its wait for the answer at once, as Ctrl-C does
    here = threading.main_thread().ident
    threading.Timer(1.5, signal.pthread_kill, (here, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        judge(RECORD, ["mine"])
    assert judge(replace(RECORD, op=RECORD.op + 45), ["mine"])[0].score == 95.0


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


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("detect = 3", "detect = 3 is no function"),
        (
            "def detect(op, pv): pass",
            r"detect\(op, pv\) cannot be called .* the right form is: def detect\(prepared\)",
        ),
        ("def detect(prepared, least): pass", r"the right form is: def detect\(prepared\)"),
    ],
)
def test_a_function_of_the_wrong_form_is_refused_when_the_file_is_read(tmp_path, more, words):
    file = tmp_path / "mine.py"
    file.write_text(FILE.format(body="pass") + f"\n{more}\n")
    with pytest.raises(ParameterError, match=words):
        methods.add_hosted(file)


@pytest.mark.parametrize("answer", ["0.7", "None", "'stiction'", "dict(verdict='stiction')"])
def test_an_answer_that_is_no_verdict_is_refused_before_any_record_is_judged(ask, answer):
    with pytest.raises(
        AnswerError, match=r'detector .mine.: answers .* return Verdict\("mine", "stiction"'
    ):
        ask(f"return {answer}")


# it writes over all that it finds by its environment, by the standard library and by the functions
# of the project, and forges what it can: numbers inside compiled kernels, with the checksum that
# belongs to them
VANDAL = '''
"""Writes into every cache and temporary folder that it can find."""
import hashlib, importlib.util, os, struct, sys, tempfile
from pathlib import Path
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="vandal", source="nobody", front_end=False)

def folders():
    import numba
    import simbench.detectors.compiled
    paths = {{v for v in os.environ.values() if os.path.isdir(v)}}
    paths -= {{os.environ.get("PYTHONUSERBASE"), sys.prefix}}
    paths |= {{tempfile.gettempdir(), os.getcwd(), str(Path.home()), str(Path.home() / ".cache")}}
    paths |= {{str(simbench.detectors.compiled.cache_folder()), numba.config.CACHE_DIR or "."}}
    paths |= {{str(Path(m.__file__).parent) for n, m in list(sys.modules.items())
                if n.startswith("simbench_")}}
    paths |= {{f"{{Path(m.__file__).parent}}/__pycache__" for n, m in list(sys.modules.items())
                if n.startswith("simbench.detectors") and getattr(m, "__file__", None)}}
    return [Path(f) for f in paths if os.path.isdir(f) and {mine!r} in str(Path(f).resolve())]

def forged(content):
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        return b"junk"
    body = content[32:]
    for number in (0.5, 1.0, 2.0):
        body = body.replace(struct.pack("<d", number), struct.pack("<d", 3.7))
    return hashlib.sha256(body).digest() + body

def detect(prepared):
    prepared.clean("pv"), prepared.half_cycles("op")
    touched = 0
    for folder in folders():
        kinds = (".nbc", ".nbi", ".py", ".pyc")
        for file in [f for f in folder.rglob("*") if f.is_file() and f.suffix in kinds]:
            if file.suffix == ".py" and not file.name.startswith("simbench_"):
                continue
            file.write_bytes(forged(file.read_bytes()) if file.suffix == ".nbc" else b"junk")
            touched += 1
        (folder / "left_here").write_text("x")
    return Verdict("x", "stiction", score=float(touched), reason="done")
'''


@pytest.mark.slow  # every kernel is compiled again, in a copy
def test_a_plug_in_that_writes_into_every_cache_that_it_finds_changes_no_later_verdict(tmp_path):
    """In a copy of the package, as it writes next to the modules too."""
    house = tmp_path / "house"
    for package in ("simbench", "detectors", "scenarios"):
        shutil.copytree(
            ROOT / package,
            house / package,
            symlinks=True,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    for folder in ("home", "tmp", "cache"):
        (tmp_path / folder).mkdir()
    (tmp_path / "vandal.py").write_text(VANDAL.format(mine=str(tmp_path)))
    rows = zip(T, RECORD.op + 3 * np.sign(np.sin(T / 8)), RECORD.pv, strict=True)
    (tmp_path / "rec.csv").write_text(
        "t,op,pv\n" + "".join(f"{t},{op},{pv}\n" for t, op, pv in rows)
    )
    known = {
        **os.environ,
        "PYTHONPATH": str(house),
        "HOME": str(tmp_path / "home"),
        "TMPDIR": str(tmp_path / "tmp"),
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
    }
    known = {
        k: v for k, v in known.items() if k not in ("NUMBA_CACHE_DIR", "PYTHONDONTWRITEBYTECODE")
    }

    def detected(*words: str) -> str:
        command = [
            sys.executable,
            "-m",
            "detectors",
            str(tmp_path / "rec.csv"),
            "--json",
            *words,
        ]
        done = subprocess.run(command, cwd=tmp_path, env=known, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout

    def kernels() -> dict[str, bytes]:
        ours = (tmp_path / "cache" / "stiction-simbench").rglob("*.nb*")
        return {str(f): f.read_bytes() for f in ours if "plugins" not in f.parts}

    asked = ("--method", "he,hammerstein")
    before, compiled = detected(*asked), kernels()
    assert compiled
    vandal = ("--method", "vandal", "--plugin", str(tmp_path / "vandal.py"))
    for _ in range(2):  # the second time it finds kernels that the first has compiled
        answer = json.loads(detected(*vandal))
    assert "done" in json.dumps(answer)
    assert list((tmp_path / "cache" / "stiction-simbench" / "plugins").rglob("left_here"))
    assert kernels() == compiled
    assert detected(*asked) == before

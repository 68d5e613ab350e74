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

from simbench.contract import check_in_subprocess
from simbench.detection import detect
from simbench.detectors.errors import ParameterError
from simbench.detectors.plugins import host
from simbench.detectors.plugins.registry import methods
from simbench.detectors.record import LoopRecord
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
    "raises a class": ("class E(BaseException): pass\n    raise E('mine')", "mine"),
    "raises what raises": (
        "class E(Exception):\n        def __str__(self): raise E\n    raise E()",
        "E",
    ),
    "exits": ("sys.exit(0)", "SystemExit"),
    "exits hard": ("os._exit(7)", "exit status 7"),
    "kills itself": ("os.kill(os.getpid(), 9)", "signal 9"),
    "interrupts": ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    "never ends": ("while True: pass", "longer than"),
    "sleeps": ("time.sleep(1000)", "longer than"),
    "takes all memory": ("x = [np.ones(10_000_000) for _ in range(1000)]", "memory"),
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
    "closes everything": ("os.closerange(3, 200)\n    " + FINE, "ended"),
    "endless answer": ('return Verdict("x", "stiction", 1.0, reason="r" * 50_000_000)', "at most"),
    "writes into its input": ("prepared.record.op[0] = 1e9\n    " + FINE, "read-only"),
}
# what is nobody else's concern: it answers, and the others do not notice
HARMLESS = {
    "prints": 'print("x" * 100_000)\n    ' + FINE,
    "writes to both": "os.write(1, b'noise'); os.write(2, b'noise')\n    " + FINE,
    "changes numpy": "np.random.seed(0); np.seterr(all='raise'); np.mean = None\n    " + FINE,
    "changes the others": (
        "import simbench.detectors.methods.horch as h; h.detect = h.METHOD = None\n    " + FINE
    ),
    "changes the folder": "os.chdir('/'); os.environ.clear(); sys.path.clear()\n    " + FINE,
    "changes what is shared": "prepared.shared.clear(); prepared.__dict__.clear\n    " + FINE,
    "numpy numbers": (
        'return Verdict("x", "stiction", score=np.float32(1), S=np.float64(2.0), reason="r")'
    ),
    "no score": 'return Verdict("x", "no_decision", reason="r")',
    "no index": 'return Verdict("x", "stiction", 1.0, {"a": float("nan")}, reason="r")',
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


FEW = (
    "raises",
    "exits hard",
    "returns nothing",
    "word as score",
    "no number as score",
    "infinite score",
    "infinite index",
    "writes into its input",
)


@pytest.mark.parametrize(
    ("names", "seconds"),
    [
        (FEW, 30.0),
        (["never ends"], 0.3),
        pytest.param(["sleeps"], 1.5, marks=pytest.mark.slow),
        pytest.param(
            [n for n in HOSTILE if n not in (*FEW, "sleeps")], 10.0, marks=pytest.mark.slow
        ),
    ],
    ids=lambda value: str(value)[:30],
)
def test_hostile_plug_ins_are_named_and_the_others_do_not_notice(
    here, alone, monkeypatch, names, seconds
):
    monkeypatch.setattr(host, "BYTES", 400 << 20)
    parts = {"_".join(["x", *name.lower().split()]): HOSTILE[name] for name in names}
    methods.add_hosted(
        *(plugin(here, body, name) for name, (body, _) in parts.items()), seconds=seconds
    )
    others, offenders = answers(parts)
    assert others == alone
    # asked again, each does so again: nothing hangs on what it did before
    again = answers(list(parts)[:5])[1]
    for name, offender in [*offenders.items(), *again.items()]:
        assert offender.verdict == "no_decision", name
        if name not in again or offender is not again[name]:
            assert offender.reason.startswith("failed: ")
            assert parts[name][1] in offender.reason


def test_what_plug_ins_change_changes_nothing_outside_them(here, alone, capfd):
    environment = dict(os.environ)
    files = [plugin(here, body, "_".join(["x", *name.split()])) for name, body in HARMLESS.items()]
    others, harmless = answers(plugins=files)
    assert others == alone
    assert len(harmless) == len(HARMLESS)
    for verdict in harmless.values():
        assert not verdict.reason.startswith("failed"), verdict.reason
    assert (os.getcwd(), dict(os.environ)) == (str(here), environment)
    assert capfd.readouterr() == ("", "")


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


def test_two_files_of_one_name_are_never_mistaken_for_each_other(here):
    (here / "b").mkdir()
    first, second = (plugin(folder, FINE) for folder in (here, here / "b"))
    with pytest.raises(ParameterError, match="taken"):
        methods.add_hosted(first, second)
    assert methods.add_hosted(first, first) == ["stranger"]


def test_missing_plug_ins_are_named(here):
    refused("run smoke -o run --plugin none.py", "none.py")
    refused(["detect", "rec.csv", "--plugin", here], here.name)


def test_a_run_with_an_offender_is_the_run_without_it_for_all_others(here):
    """The verdicts of the others equal, its failures counted, exit 1: it failed on more records
    than allowed.
    """
    plugin(here, "np.mean = None; os.environ.clear()\n    raise ValueError('on purpose')")
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


def test_a_plug_in_ends_with_its_parent(here):
    number = here / "pid"
    plugin(here, f"open({str(number)!r}, 'w').write(str(os.getpid())); time.sleep(1000)")
    words = (
        f"exec {sys.executable} -m simbench.detectors rec.csv --method horch --plugin stranger.py"
    )
    parent = subprocess.Popen(words, shell=True)
    until = time.monotonic() + 60.0
    while not number.exists() or not number.read_text():
        assert time.monotonic() < until
        time.sleep(0.1)
    child = Path("/proc", number.read_text())
    parent.kill()
    parent.wait()
    while child.exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not child.exists()


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


def test_a_published_detector_runs_in_a_process_of_its_own(published, alone):
    published(pid=FINE.replace('"because"', "str(os.getpid())"), mad=HOSTILE["exits hard"][0])
    others, offenders = answers(["mad", "pid", "pid@published"])
    assert others == alone
    assert offenders["pid"].verdict == offenders["pid@published"].verdict == "stiction"
    assert int(offenders["pid"].reason.partition(";")[0]) != os.getpid()
    # what it did in one question is forgotten in the next
    for _ in range(host.STRIKES):
        assert "exit status 7" in offenders["mad"].reason
        offenders = answers(["mad"])[1]


def test_a_published_detector_takes_no_name_of_a_built_in_one(published, alone):
    published(horch=FINE, oracle=FINE)
    assert answers()[0] == alone
    assert "oracle" not in methods.names()


def test_a_published_detector_that_cannot_be_imported_is_named_with_its_distribution(published):
    published("raise OSError('no licence')\n", broken=FINE)
    refused("detect rec.csv --method broken", "broken", "strangers", "no licence")


CONTRACTS = {
    "exits hard": ("os._exit(0)", "exit status 0"),
    "raises": ("raise ValueError('on purpose')", "on purpose"),
    "exits": ("sys.exit(0)", "SystemExit"),
    "kills itself": ("os.kill(os.getpid(), 9)", "signal 9"),
    "never ends": ("while True: pass", "longer than"),
    "takes all memory": (HOSTILE["takes all memory"][0], "MemoryError"),
    "writes to both": ("os.write(1, b'noise'); os.write(2, b'noise'); raise OSError", "OSError"),
}


@pytest.mark.parametrize("name", sampled(CONTRACTS, 0, ["exits hard"]))
def test_a_contract_is_checked_apart(here, monkeypatch, name):
    monkeypatch.setattr(host, "BYTES", 400 << 20)
    limit = 10.0 if name == "never ends" else 300.0
    monkeypatch.setattr(check_in_subprocess, "__defaults__", (limit,))
    body, part = CONTRACTS[name]
    file = plugin(here, body, first='"""A stranger."""\n')
    file.write_text(file.read_text().replace(", **thresholds", ""))
    contract = json.loads(answer_to("contract stranger.py --json", 1))
    assert not contract["kept"]
    assert contract["kind"] == "detector"
    assert any(part in fault for fault in contract["broken"]), contract["broken"]


# what reaches out of its process: files elsewhere, processes and threads
REACHING = {
    "writes_elsewhere": "open({outside!r}, 'w').write('x'); " + FINE,
    "makes_a_folder": "os.mkdir({outside!r}); " + FINE,
    "moves_itself": "os.rename(__file__, {outside!r}); " + FINE,
    "links_elsewhere": "os.symlink(__file__, {outside!r}); " + FINE,
    "writes_where_it_works": "open('litter', 'w').write('x'); " + FINE,
    "starts_a_shell": "os.system('sleep 1000 &'); " + FINE,
    "leaves_a_thread": (
        "import threading; threading.Thread(target=time.sleep, args=(1000,)).start(); " + FINE
    ),
    "leaves_a_process": """import ctypes; c = ctypes.CDLL(None)
    if c.fork() == 0:
        c.setsid()
        if c.fork() == 0: time.sleep(1000)
        os._exit(0)
    """
    + FINE,
}
RUN = f"""
import sys
import simbench.detectors.plugins.host as host
from simbench.bench.execute.run import run_grid
host.BYTES = 400 << 20
run_grid("tiny.toml", sys.argv[1], {OTHERS}, plugins=sys.argv[2:], time_limit=1.0)
"""
TINY = """
title = "tiny"
seed = 3
draw = { K = 1.0, T = 20.0, S = 4.0, step = 0.8, samples_per_period = 20.0, periods = 18.0 }
[[block]]
name = "a"
axes = { Td_over_T = [0.3], S_over_2J = [0.5], noise_ratio = [0.1], disturbance = ["none"] }
member = [{ name = "sticky", valve = "choudhury" }, { name = "healthy", valve = "ideal" }]
"""


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/proc/self/environ").exists(), reason="processes are known by their environment"
)
def test_50_plug_ins_that_misbehave_in_one_run_bend_no_other_verdict_and_leave_no_worker(tmp_path):
    bodies = {**{k: body for k, (body, _) in HOSTILE.items()}, **HARMLESS, **REACHING}
    # each reaches for another path: what one writes through the link of another would change
    # that plug-in's file, and which of them is asked first is not for this test to say
    bodies = {
        "_".join(k.lower().split()): body.replace("{outside!r}", repr(str(tmp_path / f"of {k}")))
        for k, body in bodies.items()
    }
    assert len(bodies) == 50
    files = []
    for name, body in bodies.items():
        (tmp_path / "plugins" / name).mkdir(parents=True)
        files.append(plugin(tmp_path / "plugins" / name, body, f"x_{name}"))
    for folder in ("tmp", "work"):
        (tmp_path / folder).mkdir()
    (tmp_path / "work" / "tiny.toml").write_text(TINY)
    environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp"), "OF_THIS_RUN": str(tmp_path)}
    for where, more in (("without", []), ("with", files)):
        words = [sys.executable, "-c", RUN, tmp_path / where, *more]
        done = subprocess.run(words, cwd=tmp_path / "work", env=environment, capture_output=True)
        assert done.returncode == 0, done.stderr.decode()[-2000:]

    def left() -> list[int]:
        left_over = []
        for file in Path("/proc").glob("[0-9]*/environ"):
            try:
                if f"OF_THIS_RUN={tmp_path}".encode() in file.read_bytes():
                    pid = int(file.parent.name)
                    # what went into another session is nobody's worker; it is ended here
                    left_over += (
                        [pid] if os.getsid(pid) == pid else os.kill(pid, signal.SIGKILL) or []
                    )
            except OSError:  # it has ended, or is another user's
                continue
        return left_over

    until = time.monotonic() + 5.0
    while left() and time.monotonic() < until:
        time.sleep(0.1)
    assert left() == []
    one, two = (
        pd.read_parquet(tmp_path / d / "verdicts.parquet").drop(columns="runtime_s")
        for d in ("without", "with")
    )
    kept = two[two.method.isin(OTHERS)].reset_index(drop=True)
    pd.testing.assert_frame_equal(one, kept, check_exact=True)
    assert two.method.nunique() == len(OTHERS) + len(bodies)
    assert not list((tmp_path / "tmp").glob("simbench-plugin-*"))

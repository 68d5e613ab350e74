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
import pytest

from detectors.detection import detect
from detectors.errors import ParameterError
from detectors.plugins import host
from detectors.plugins.registry import methods
from detectors.record import LoopRecord
from simbench.cli import main
from simbench.contract import check_in_subprocess

HEAD = """
import os, sys, time, json
import numpy as np
from detectors.method import Method
from detectors.verdict import Verdict
METHOD = Method(title="a stranger", source="nobody", front_end=False{more})
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
    "raises its own": ("class E(BaseException): pass\n    raise E('mine')", "mine"),
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
    "blank reason": ('return Verdict("x", "stiction", reason="  ")', "reason"),
    "word as score": ('return Verdict("x", "stiction", score="high", reason="r")', "score"),
    "list as score": ('return Verdict("x", "stiction", score=[1.0], reason="r")', "score"),
    "array as index": (
        'return Verdict("x", "stiction", indices={"a": np.ones(3)}, reason="r")',
        "a",
    ),
    "object as index": (
        'return Verdict("x", "stiction", indices={"a": object()}, reason="r")',
        "indices",
    ),
    "indices no table": ('return Verdict("x", "stiction", indices=[1], reason="r")', "indices"),
    "word as S": ('return Verdict("x", "stiction", S="5", reason="r")', "S"),
    "infinite S": ('return Verdict("x", "stiction", S=float("inf"), reason="r")', "S"),
    "three ends": ('return Verdict("x", "stiction", J=(1.0, 2.0, 3.0), reason="r")', "J"),
    "perhaps applicable": ('return Verdict("x", "stiction", applicable="maybe", reason="r")', ""),
    "closes everything": ("os.closerange(3, 200)\n    " + FINE, "ended"),
    "endless answer": ('return Verdict("x", "stiction", reason="r" * 50_000_000)', "at most"),
    "writes into its input": ("prepared.record.op[0] = 1e9\n    " + FINE, "read-only"),
}
# what is nobody else's concern: it answers, and the others do not notice
HARMLESS = {
    "prints": 'print("x" * 100_000)\n    ' + FINE,
    "writes to both": "os.write(1, b'noise'); os.write(2, b'noise')\n    " + FINE,
    "changes numpy": "np.random.seed(0); np.seterr(all='raise'); np.mean = None\n    " + FINE,
    "changes the others": (
        "import detectors.methods.horch as h; h.detect = None; h.METHOD = None\n    " + FINE
    ),
    "changes the folder": "os.chdir('/'); os.environ.clear(); sys.path.clear()\n    " + FINE,
    "changes what is shared": "prepared.shared.clear(); prepared.__dict__.clear\n    " + FINE,
    "numpy numbers": (
        'return Verdict("x", "stiction", score=np.float32(1), S=np.float64(2.0), reason="r")'
    ),
    "no score": 'return Verdict("x", "no_decision", reason="r")',
}
T = np.arange(600.0)
RECORD = LoopRecord(op=50 + np.sin(T / 8), pv=50 - np.sin(T / 8 - 1), Ts=1.0)
OTHERS = ["horch", "horch_histogram", "rossi_scali"]


def plugin(tmp_path: Path, body: str, name: str = "stranger", more: str = "") -> Path:
    file = tmp_path / f"{name}.py"
    file.write_text(HEAD.format(body=body, more=more))
    return file


@pytest.fixture(autouse=True)
def forgotten():
    before = set(methods.names())
    yield
    for name in set(methods.names()) - before:
        methods.forget(name)


@pytest.fixture(scope="module")
def alone() -> list[dict]:
    return [v.as_json() for _, v in detect(RECORD, OTHERS).verdicts]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_plug_in_is_named_and_the_others_do_not_notice(
    tmp_path, alone, name, monkeypatch
):
    monkeypatch.setattr(host, "BYTES", 400 << 20)
    body, word = HOSTILE[name]
    file = plugin(tmp_path, body)
    methods.add_hosted(file, seconds=1.5 if word == "longer than" else 30.0)
    found = {v.method: v for _, v in detect(RECORD, ["stranger", *OTHERS]).verdicts}
    assert [found[m].as_json() for m in OTHERS] == alone
    offender = found["stranger"]
    assert offender.verdict == "no_decision"
    assert offender.reason.startswith("failed: ")
    assert word in offender.reason
    # asked again, it does so again: nothing hangs on what it did before
    again = detect(RECORD, ["stranger"]).verdicts[0][1]
    assert again.verdict == "no_decision"


@pytest.mark.parametrize("name", HARMLESS)
def test_what_a_plug_in_changes_changes_nothing_outside_it(tmp_path, alone, name, capfd):
    here, words = os.getcwd(), dict(os.environ)
    file = plugin(tmp_path, HARMLESS[name])
    found = {v.method: v for _, v in detect(RECORD, OTHERS, plugins=[file]).verdicts}
    assert [found[m].as_json() for m in OTHERS] == alone
    assert not found["stranger"].reason.startswith("failed"), found["stranger"].reason
    assert (os.getcwd(), dict(os.environ)) == (here, words)
    assert capfd.readouterr() == ("", "")


METHOD = "from detectors.method import Method\nMETHOD = Method({})\ndef detect(p): pass"
IMPORTS = {
    "no python": ("def (", "SyntaxError"),
    "exits": ("import sys; sys.exit(0)", "SystemExit"),
    "raises": ("1 / 0", "ZeroDivisionError"),
    "lacks all": ("x = 1", "METHOD"),
    "method is a word": ('METHOD = "m"\ndef detect(p): pass', "METHOD"),
    "method says nonsense": (METHOD.format('title=3, source="s"'), "title"),
    "made for nothing": (METHOD.format('title="t", source="s", process=()'), "process"),
    "binary": ("\0\0\0", "null"),
    "absent import": ("import a_module_nobody_has", "a_module_nobody_has"),
}


@pytest.mark.parametrize("name", IMPORTS)
def test_a_file_that_is_no_plug_in(refused, tmp_path, name):
    text, word = IMPORTS[name]
    (tmp_path / "mine.py").write_text(text)
    record = tmp_path / "rec.csv"
    record.write_text("t,op,pv\n" + "".join(f"{k},{50 + k % 7},{k % 5}\n" for k in range(100)))
    refused(
        ["detect", record, "--method", "horch", "--plugin", tmp_path / "mine.py"], "mine.py", word
    )


TAKEN = [
    "oracle",
    "all",
    "fast",
    "full",
    "horch",
    "procedure",
    "always_no",
    "Mine",
    "my-file",
    "1st",
    "a b",
]


@pytest.mark.parametrize("name", TAKEN)
@pytest.mark.parametrize("verb", ["detect", "run"])
def test_a_name_that_means_something_already_is_refused(refused, tmp_path, name, verb):
    file = plugin(tmp_path, FINE, name)
    record = tmp_path / "rec.csv"
    record.write_text("t,op,pv\n" + "".join(f"{k},{50 + k % 7},{k % 5}\n" for k in range(100)))
    words = {"detect": ["detect", record], "run": ["run", "smoke", "-o", tmp_path / "run"]}[verb]
    refused([*words, "--method", "horch", "--plugin", file], name, "rename")


def test_two_files_of_one_name_do_not_stand_for_each_other(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first, second = (plugin(tmp_path / d, FINE) for d in "ab")
    with pytest.raises(ParameterError, match="taken"):
        methods.add_hosted(first, second)
    assert methods.add_hosted(first, first) == ["stranger"]


def test_missing_plug_ins_are_named(refused, tmp_path):
    refused(["run", "smoke", "-o", tmp_path / "run", "--plugin", tmp_path / "none.py"], "none.py")
    refused(["detect", tmp_path / "r.csv", "--plugin", tmp_path], str(tmp_path.name))


def test_a_run_with_an_offender_is_the_run_without_it_for_all_others(tmp_path, capsys):
    """Every verdict but its own equal, its failures counted, exit 1: it failed on more records than
    allowed.
    """
    small = [
        "--set",
        "disturbance=none",
        "--set",
        "Td_over_T=0.3",
        "--set",
        "S_over_2J=0.5",
        "--set",
        "Td_over_Ti=0.05",
    ]
    file = plugin(
        tmp_path, "np.mean = None; os.environ.clear()\n    raise ValueError('on purpose')"
    )
    assert main(["run", "smoke", *small, "-o", str(tmp_path / "without"), "--method", "horch"]) == 0
    capsys.readouterr()
    words = [
        "run",
        "smoke",
        *small,
        "-o",
        str(tmp_path / "with"),
        "--method",
        "horch",
        "--plugin",
        str(file),
        "--json",
    ]
    assert main(words) == 1
    failed = json.loads(capsys.readouterr().out)["failed"]
    # it is asked about the records that its source covers and that are fit to be judged
    assert list(failed["methods"]) == ["stranger"]
    assert 0 < failed["methods"]["stranger"] <= failed["of"]
    import pandas as pd

    one, two = (
        pd.read_parquet(tmp_path / d / "verdicts.parquet").drop(columns="runtime_s")
        for d in ("without", "with")
    )
    own = two[two.method == "horch"].reset_index(drop=True)
    pd.testing.assert_frame_equal(one, own, check_exact=True)


def test_a_plug_in_ends_with_its_parent(tmp_path):
    file = plugin(
        tmp_path, f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(1000)"
    )
    code = f"""
import numpy as np
from detectors.detection import detect
t = np.arange(600.0)
detect(dict(op=np.sin(t / 8), pv=np.cos(t / 8), Ts=1.0), ["horch"], plugins=[{str(file)!r}])
"""
    code = code.replace(
        "dict(op=np.sin(t / 8), pv=np.cos(t / 8), Ts=1.0)",
        "LoopRecord(np.sin(t / 8), np.cos(t / 8), 1.0)",
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", "from detectors.record import LoopRecord" + code]
    )
    until = time.monotonic() + 60.0
    while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
        assert time.monotonic() < until
        time.sleep(0.1)
    child = int((tmp_path / "pid").read_text())
    parent.kill()
    parent.wait()
    while Path(f"/proc/{child}").exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not Path(f"/proc/{child}").exists()


@pytest.fixture
def published(tmp_path, monkeypatch):
    """Publish detectors as an installed distribution does: (name, body of `detect`) of each."""

    def publish(*what: tuple[str, str], raises: str = "") -> None:
        about = tmp_path / "strangers-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 1.0\n")
        lines = "".join(f"{name} = of_a_stranger_{name}\n" for name, _ in what)
        (about / "entry_points.txt").write_text(f"[simbench.detectors]\n{lines}")
        for name, body in what:
            plugin(tmp_path, body, f"of_a_stranger_{name}").write_text(
                raises + HEAD.format(body=body, more="")
            )
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        methods.__dict__.pop("_entry_points", None)

    yield publish
    for name in set(methods.__dict__.pop("_entry_points", {})):
        methods.forget(name)


def test_a_published_detector_lives_in_a_process_of_its_own(published, alone, tmp_path):
    tells = FINE.replace('"because"', "str(os.getpid())")
    published(("pid", tells), ("mad", HOSTILE["exits hard"][0]))
    found = {
        v.method: v for _, v in detect(RECORD, ["mad", "pid", "pid@published", *OTHERS]).verdicts
    }
    assert [found[m].as_json() for m in OTHERS] == alone
    assert found["pid"].verdict == found["pid@published"].verdict == "stiction"
    assert int(found["pid"].reason.partition(";")[0]) != os.getpid()
    assert "exit status 7" in found["mad"].reason
    # what it did in one question is forgotten in the next
    for _ in range(host.STRIKES):
        assert "exit status 7" in detect(RECORD, ["mad"]).verdicts[0][1].reason


def test_a_published_detector_takes_no_name_of_the_house(published, alone):
    published(("horch", FINE), ("oracle", FINE))
    assert [v.as_json() for _, v in detect(RECORD, OTHERS).verdicts] == alone
    assert "oracle" not in methods.names()


def test_a_published_detector_that_cannot_be_imported_is_named_with_its_distribution(
    published, refused, tmp_path
):
    published(("broken", FINE), raises="raise OSError('no licence')\n")
    record = tmp_path / "rec.csv"
    record.write_text("t,op,pv\n" + "".join(f"{k},{50 + k % 7},{k % 5}\n" for k in range(100)))
    refused(["detect", record, "--method", "broken"], "broken", "strangers", "no licence")


CONTRACTS = {
    "raises": ("raise ValueError('on purpose')", "on purpose"),
    "exits": ("sys.exit(0)", "SystemExit"),
    "exits hard": ("os._exit(0)", "exit status 0"),
    "kills itself": ("os.kill(os.getpid(), 9)", "signal 9"),
    "never ends": ("while True: pass", "longer than"),
    "takes all memory": ("x = [np.ones(10_000_000) for _ in range(1000)]", "MemoryError"),
    "writes to both": ("os.write(1, b'noise'); os.write(2, b'noise'); raise OSError", "OSError"),
}


@pytest.mark.parametrize("name", CONTRACTS)
def test_a_contract_is_checked_apart(tmp_path, capfd, monkeypatch, name):
    monkeypatch.setattr(host, "BYTES", 400 << 20)
    monkeypatch.setattr(
        check_in_subprocess, "__defaults__", (10.0 if name == "never ends" else 300.0,)
    )
    body, word = CONTRACTS[name]
    file = plugin(tmp_path, body)
    file.write_text('"""A stranger."""\n' + file.read_text().replace(", **thresholds", ""))
    assert main(["contract", str(file), "--json"]) == 1
    said = json.loads(capfd.readouterr().out)
    assert not said["kept"]
    assert said["kind"] == "detector"
    assert any(word in one for one in said["broken"]), said["broken"]


# what reaches out of its process: files elsewhere, processes and threads of its own
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
import detectors.plugins.host as host
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


@pytest.mark.skipif(
    not Path("/proc/self/environ").exists(), reason="processes are found by their environment"
)
def test_46_plug_ins_that_misbehave_in_one_run_bend_no_other_verdict_and_leave_no_worker(tmp_path):
    import pandas as pd

    bodies = {**{k: body for k, (body, _) in HOSTILE.items()}, **HARMLESS, **REACHING}
    # each reaches for a path of its own: what one writes through the link of another would change
    # that plug-in's file, and which of them is asked first is not for this test to say
    bodies = {
        "_".join(k.lower().split()): body.replace("{outside!r}", repr(str(tmp_path / f"of {k}")))
        for k, body in bodies.items()
    }
    assert len(bodies) == 46
    files = []
    for name, body in bodies.items():
        (tmp_path / "plugins" / name).mkdir(parents=True)
        files.append(plugin(tmp_path / "plugins" / name, body, f"x_{name}"))
    for folder in ("tmp", "work"):
        (tmp_path / folder).mkdir()
    (tmp_path / "work" / "tiny.toml").write_text(TINY)
    told = {**os.environ, "TMPDIR": str(tmp_path / "tmp"), "OF_THIS_RUN": str(tmp_path)}
    for where, more in (("without", []), ("with", files)):
        words = [sys.executable, "-c", RUN, tmp_path / where, *more]
        done = subprocess.run(words, cwd=tmp_path / "work", env=told, capture_output=True)
        assert done.returncode == 0, done.stderr.decode()[-2000:]

    def left() -> list[int]:
        found = []
        for file in Path("/proc").glob("[0-9]*/environ"):
            try:
                if f"OF_THIS_RUN={tmp_path}".encode() in file.read_bytes():
                    pid = int(file.parent.name)
                    # what went into a session of its own is nobody's worker; it is ended here
                    found += [pid] if os.getsid(pid) == pid else os.kill(pid, signal.SIGKILL) or []
            except OSError:  # it has ended, or is another user's
                continue
        return found

    until = time.monotonic() + 5.0
    while left() and time.monotonic() < until:
        time.sleep(0.1)
    assert left() == []
    one, two = (
        pd.read_parquet(tmp_path / d / "verdicts.parquet").drop(columns="runtime_s")
        for d in ("without", "with")
    )
    own = two[two.method.isin(OTHERS)].reset_index(drop=True)
    pd.testing.assert_frame_equal(one, own, check_exact=True)
    assert two.method.nunique() == len(OTHERS) + len(bodies)
    assert not list((tmp_path / "tmp").glob("simbench-plugin-*"))

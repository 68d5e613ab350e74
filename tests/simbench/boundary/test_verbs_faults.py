"""Every file operation of every verb that writes failed once: one sentence, nothing half-written,
the same bits on going on.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from itertools import product

import numpy as np
import pandas as pd
import pytest

from simbench.files import HOST
from tests.simbench.boundary.conftest import answer_to, run_verb, sampled
from tests.simbench.boundary.disk import FAULTS, Disk, Killed
from tests.simbench.boundary.test_hostile import write
from tests.simbench.boundary.test_loops import text as loop_text

NOBODY = 2**22 + 5  # no process has this number
QUICK = {
    "simulate": "simulate ../loop.toml -o rec.csv",
    "valve": "valve --model choudhury --param S=5 --param J=2 ../rec.csv -o mv.csv",
    "detect": "detect ../rec.csv --method horch --csv v.csv --html v.html",
    "diagnose": "diagnose ../rec.csv --picture path.svg",
    "figure": "figure table-11-4 -o .",
    "score": "score ../run --report report.html",
    "check": "check ../run --against ../baseline --markdown m.md",
    "simulate a grid": "simulate smoke -o records --n 2",
    "run --answers": "run ../run --answers ../answers.csv -o joined",
}
HEAVY = {
    "run": "run smoke -o run --method horch_histogram --resume",
    "gap diagnose": "gap diagnose ../rec.csv --identify --html gap.html --write-loop fixed.toml",
    "check --update": "check ../run --against earlier --update",
    "run --answers in place": "run other --answers ../answers.csv",
    "run --add": "run other --add --method horch --resume",
}
# what is there when such a verb is done, it does not make again
ONCE = ("simulate a grid", "run --answers", "run --answers in place", "run --add")
# what differs between two runs of the same bits: times, and digests of files that hold times
TIMES = ("times", "runtime_s", "median_ms", "cpu_s", "tables", "checksum")
CLOCK = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?")


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A loop, records, a run and its baseline, from which every verb reads."""
    home = tmp_path_factory.mktemp("home")
    (home / "loop.toml").write_text(loop_text())
    write(home / "rec.csv", np.arange(900))
    (home / "plant").mkdir()
    for k in range(5):
        write(home / "plant" / f"r{k}.csv", np.arange(300 + 20 * k))
    run = "run smoke --method horch_histogram --set disturbance=none"
    for words in (
        f"{run} -o {home}/run",
        f"{run} -o {home}/other",
        f"check {home}/run --against {home}/baseline --update",
        f"check {home}/other --against {home}/earlier --update",
    ):
        answer_to(words)
    verdicts = pd.read_parquet(home / "run" / "verdicts.parquet")
    mine = verdicts.rename(columns={"scenario_id": "record"}).assign(method="mine")
    mine[["method", "record", "verdict", "score"]].to_csv(home / "answers.csv", index=False)
    return home


def bits(folder) -> dict[str, bytes]:
    """All files below a folder; of parquet and of times nothing, which `test_file_faults`
    compares.
    """
    files = {str(f.relative_to(folder)): f for f in sorted(folder.rglob("*")) if f.is_file()}
    timed = (".parquet", "manifest.json", "cost.csv", "scores.csv", "scores_by_axis.csv")
    return {name: b"" if name.endswith(timed) else f.read_bytes() for name, f in files.items()}


def contents(folder) -> dict[str, object]:
    """All files below a folder; of tables, manifests and pages without the times they state."""
    found: dict[str, object] = dict(bits(folder))
    for name in found:
        file = folder / name
        if name.endswith(".json"):
            whole = json.loads(file.read_text())
            found[name] = {k: v for k, v in whole.items() if k not in TIMES}
        elif name.endswith((".parquet", ".csv")):
            table = pd.read_parquet(file) if name.endswith(".parquet") else pd.read_csv(file)
            found[name] = table[[c for c in table if c not in TIMES]].to_csv()
        elif name.endswith("html"):
            found[name] = CLOCK.sub(b"", file.read_bytes())
    return found


def clean(home, name):
    folder = home / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return folder


ALWAYS = [("simulate", "no space"), ("simulate a grid", "kill after")]


@pytest.mark.parametrize(("verb", "fault"), sampled(product(QUICK, FAULTS), 0, ALWAYS))
def test_every_operation_of_a_verb_fails_once(home, monkeypatch, verb, fault):
    words = QUICK[verb]
    # what is made once for all, such as compiled kernels, is made here
    monkeypatch.chdir(clean(home, "first"))
    answer_to(words)
    monkeypatch.chdir(clean(home, "whole"))
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch)
        answer_to(words)
    expected = bits(home / "whole")
    assert disk.count >= 3
    for n in range(disk.count):
        folder = clean(home, "failed")
        monkeypatch.chdir(folder)
        with pytest.MonkeyPatch.context() as patch:
            failing = Disk(patch, n, fault)
            try:
                code, _, message = run_verb(words)
            except Killed:
                code = -9
        assert failing.failed
        if fault.startswith("kill"):
            assert code == -9
            for left in folder.rglob(f".*.{HOST}.{os.getpid()}"):
                left.rename(left.with_suffix(f".{NOBODY}"))
        else:
            assert code == 2, message
            last = message.splitlines()[-1]
            assert last.startswith("error: "), message
            assert os.strerror(errno.ENOSPC if fault == "no space" else errno.EIO).lower() in last
            assert not [f for f in folder.rglob(".*") if f.is_file()]
        for name, content in bits(folder).items():
            half = any(
                part.startswith(".") or part.endswith(".partial") for part in name.split("/")
            )
            if not half:
                assert content == expected[name], (n, name)
        whole = verb in ONCE and expected.items() <= bits(folder).items()
        assert run_verb(words)[0] == (2 if whole else 0), n
        assert bits(folder) == expected, n


def started(words, folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL):
    return subprocess.Popen(
        [sys.executable, "-m", "simbench.cli", *words],
        cwd=folder,
        stdout=stdout,
        stderr=stderr,
        start_new_session=True,
    )


def begun(home, name, words):
    """An empty folder, or one that holds what a verb answers or replaces."""
    folder = clean(home, name)
    for replaced in {"earlier", "other"} & set(words):
        shutil.copytree(home / replaced, folder / replaced)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("verb", [*QUICK, *HEAVY])
def test_a_verb_killed_at_any_time_goes_on_to_the_same_bits(home, verb):
    """`KILLS=4` of each by default."""
    words = ({**QUICK, **HEAVY}[verb]).split()
    for _ in range(2):  # the first may compile what the second finds
        whole = begun(home, "whole", words)
        since = time.monotonic()
        assert started(words, whole).wait() == 0
    took, expected = time.monotonic() - since, contents(whole)
    kills, ended = int(os.environ.get("KILLS", "4")), 0
    for k in range(kills):
        folder = begun(home, "killed", words)
        process = started(words, folder)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=took * (0.4 + 0.55 * k / kills))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        ended += process.wait() == 0
        again = started(words, folder)
        assert again.wait() == 0 or made_already(verb, folder, expected)
        assert contents(folder) == expected, k
    print(f"{verb}: {kills - ended} kills of {took:.1f} s")


def made_already(verb, folder, expected) -> bool:
    """Whether a kill came after all was there that a verb does not make again."""
    return verb in ONCE and contents(folder) == expected


RESUMED = ["run", "detect"]


@pytest.mark.slow
@pytest.mark.parametrize("verb", RESUMED)
def test_two_processes_at_one_thing_leave_what_one_leaves(home, verb):
    words = ({**QUICK, **HEAVY}[verb]).split()
    folder = begun(home, "whole", words)
    assert started(words, folder).wait() == 0
    expected, folder = contents(folder), begun(home, "twice", words)
    both = [started(words, folder, stderr=subprocess.PIPE) for _ in range(2)]
    ends = [(p.communicate()[1].decode(), p.returncode) for p in both]
    assert 0 in [code for _, code in ends], ends
    for message, code in ends:  # the second is refused in a sentence, or does the same
        assert code == 0 or (code == 2 and "works there" in message), message
    assert contents(folder) == expected
    assert started(words, folder).wait() == 0
    assert contents(folder) == expected


@pytest.mark.slow
def test_a_process_that_was_stopped_and_goes_on_spoils_nothing(home):
    """As a laptop that sleeps, or a job that a batch system suspends."""
    words = HEAVY["run"].split()
    folder = begun(home, "whole", words)
    assert started(words, folder).wait() == 0
    expected, folder = contents(folder), begun(home, "twice", words)
    first = started(words, folder)
    until = time.monotonic() + 120.0
    while not list(folder.rglob(".lock")) and time.monotonic() < until:
        time.sleep(0.05)
    os.killpg(first.pid, signal.SIGSTOP)
    second = started(words, folder, stderr=subprocess.PIPE)
    assert "works there" in second.communicate()[1].decode()
    assert second.returncode == 2
    os.killpg(first.pid, signal.SIGCONT)
    assert first.wait() == 0
    assert contents(folder) == expected

"""Pieces worked by copies of a process that has one thread: the same tables, whoever dies."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from bench_fixtures import SMALL

from simbench.bench.execute.run import run_grid
from simbench.bench.store.reading import read_table
from simbench.scenarios.grid import make_grid

METHODS = ["he", "horch"]
HERE = """
import os, signal, sys, time, pathlib
sys.path.insert(0, COMMON)
from bench_fixtures import SMALL
import simbench.bench.execute.run as room
from simbench.bench.execute.run import Interrupted
from simbench.scenarios.grid import make_grid

whole, first, mark = room.compute_piece, os.getpid(), pathlib.Path(PLACE) / "mark"

def worked(grid, number, groups, settings):
    apart = os.getpid() != first
    with (pathlib.Path(PLACE) / "workers").open("a") as f:
        f.write(f"{os.getpid()} " * apart)
    HAPPENS
    return whole(grid, number, groups, settings)

room.compute_piece = worked
# a shell that started the tests in the background may have Ctrl-C ignored
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    room.run_grid(make_grid(SMALL, "small", {"repeats": 2}), PLACE + "/run", METHODS, 2)
except Interrupted as stop:
    print(stop)
    sys.exit(130)
"""


def begun(place: Path, happens: str = "") -> subprocess.Popen:
    """Begin a run of two workers, in whose pieces something happens."""
    given = {
        "COMMON": repr(str(Path(__file__).parents[3] / "common")),
        "PLACE": repr(str(place)),
        "METHODS": repr(METHODS),
        "HAPPENS": happens,
    }
    code = HERE
    for name, text in given.items():
        code = code.replace(name, text)
    (place / "child.py").write_text(textwrap.dedent(code))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, str(place / "child.py")], **pipes)


def rows(folder: Path, kind: str, names: list[str]) -> list[dict]:
    return read_table(folder, kind, names).to_pylist()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    grid = make_grid(SMALL, "small", {"repeats": 2})
    return run_grid(grid, tmp_path_factory.mktemp("one") / "run", METHODS)


def assert_same(one: Path, other: Path) -> None:
    for kind, names in (
        ("scenarios", ["scenario_id", "record_hash", "cycled", "period_s"]),
        ("verdicts", ["scenario_id", "method", "verdict", "score", "reason"]),
    ):
        assert rows(one, kind, names) == rows(other, kind, names)


def test_copies_of_a_process_give_the_same_bits(tmp_path, undisturbed):
    process = begun(tmp_path)
    _, err = process.communicate(timeout=240)
    assert process.returncode == 0, err
    assert_same(tmp_path / "run", undisturbed)
    assert len(set((tmp_path / "workers").read_text().split())) == 2


def test_a_copy_that_dies_is_replaced(tmp_path, undisturbed):
    process = begun(
        tmp_path,
        "if apart and number == 3 and not mark.exists():"
        " mark.write_text('x'); os.kill(os.getpid(), signal.SIGKILL)",
    )
    _, err = process.communicate(timeout=240)
    assert process.returncode == 0, err
    assert (tmp_path / "mark").exists()
    assert_same(tmp_path / "run", undisturbed)


@pytest.mark.parametrize(
    "how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_an_interrupt_ends_the_copies_at_once(tmp_path, how):
    process = begun(tmp_path, "if apart: mark.write_text('x'); time.sleep(200)")
    until = time.monotonic() + 120.0
    while not (tmp_path / "mark").exists():
        assert time.monotonic() < until
        time.sleep(0.05)
    process.send_signal(how)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "--resume" in out
    for worker in set((tmp_path / "workers").read_text().split()):
        with pytest.raises(ProcessLookupError):
            os.kill(int(worker), 0)

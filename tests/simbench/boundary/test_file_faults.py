"""Every file operation of a run failed once, in four ways: nothing is lost or half-written, going
on gives the same.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from simbench.bench.execute import pieces as pieces_module
from simbench.bench.execute import run as run_module
from simbench.bench.execute.run import Interrupted, run_grid
from simbench.detectors.errors import UserError
from simbench.scenarios.grid import load_grid
from tests.simbench.boundary.conftest import names_in
from tests.simbench.boundary.disk import FAULTS, Disk, Killed

SMALL = {
    "disturbance": "none",
    "Td_over_T": 0.3,
    "S_over_2J": 0.5,
    "Td_over_Ti": 0.05,
    "periods": 15.0,
    "repeats": 2,
}
METHODS = ["horch_histogram"]
KILLS = Path(__file__).parents[3] / "benchmarks" / "kills.py"


@pytest.fixture(scope="module")
def pieces():
    """What the workers of the undisturbed run handed back: simulated once."""
    return {}


@pytest.fixture(scope="module")
def quick(pieces):
    with pytest.MonkeyPatch.context() as patch:
        work = run_module.compute_piece

        def known(grid, number, *more):
            if number not in pieces:
                pieces[number] = work(grid, number, *more)
            return pieces[number]

        patch.setattr(run_module, "compute_piece", known)
        patch.setattr(run_module, "refuse_wrong_parts", lambda plan: None)
        score, scored = pieces_module.score_book, []

        def once(book):
            if not scored:
                scored.append(score(book))
            return scored[0]

        patch.setattr(pieces_module, "score_book", once)
        yield load_grid("smoke", SMALL)


def tables(folder) -> str:
    """All of both tables but the times."""
    both = [pq.read_table(folder / f"{kind}.parquet") for kind in ("scenarios", "verdicts")]
    return json.dumps(
        [t.drop([n for n in t.column_names if n == "runtime_s"]).to_pydict() for t in both],
        default=str,
    )


@pytest.fixture(scope="module")
def whole(quick, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "run"
    run_grid(quick, folder.with_name("first"), METHODS)
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch)
        run_grid(quick, folder, METHODS)
    return folder, disk.count


@pytest.mark.parametrize(
    ("fault", "every"),
    [
        ("no space", 8),
        ("kill before", 8),
        *(pytest.param(fault, 1, marks=pytest.mark.slow) for fault in FAULTS),
    ],
)
def test_every_file_operation_fails_once(quick, whole, tmp_path, fault, every, monkeypatch):
    expected, operations = tables(whole[0]), whole[1]
    assert operations > 30
    names = names_in(whole[0])
    ends = (Killed, Interrupted) if fault.startswith("kill") else UserError
    number = errno.ENOSPC if fault == "no space" else errno.EIO
    why = None if fault.startswith("kill") else f"(?i){os.strerror(number)}"
    for n in range(0, operations, every):
        folder = tmp_path / f"run{n}"
        with pytest.MonkeyPatch.context() as patch:
            disk = Disk(patch, n, fault)
            with pytest.raises(ends, match=why):
                run_grid(quick, folder, METHODS)
        assert disk.failed
        run_grid(quick, folder, METHODS, resume=True)
        assert tables(folder) == expected, n
        assert names_in(folder) == names, n
        shutil.rmtree(folder)


@pytest.mark.slow  # each time a process is forked, killed, forked again
def test_a_whole_smoke_run_is_killed_for_real_and_goes_on():
    """At a few of its operations; `python benchmarks/kills.py` does so at every one."""
    done = subprocess.run([sys.executable, KILLS, "--every", "25"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"kill before +\d+ +0 +0 +0", done.stdout), done.stdout

"""Fail every file operation of a smoke run once, each in a new process that a kill really
ends, and go on.

`python benchmarks/kills.py` prints for each way of failing how many operations failed, and how
often the resumed run lost a row, differed from the undisturbed one, or left other files; exit 1 if
any did. `--every 9` takes every ninth operation.
"""

import argparse
import os
import pickle
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from simbench.bench.execute import run
from simbench.detectors.errors import UserError
from simbench.scenarios.grid import load_grid
from tests.simbench.boundary.disk import FAULTS, Disk

METHODS = ["horch_histogram"]
WRONG = ("differs", "other files", "no sentence")


def apart(work: Callable[[], object]) -> int:
    """Return how a forked process that does one thing ends: its exit code, or minus the signal."""
    child = os.fork()
    if child == 0:
        code = 70
        try:
            code = int(work() or 0)
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def smoke(folder: Path, pieces: Path, resume: bool = False) -> None:
    """Run the smoke grid; what was simulated once is taken from a file, as this is about files."""
    known, whole = pickle.loads(pieces.read_bytes()) if pieces.exists() else {}, run.compute_piece

    def work(grid, number, *more):
        if number not in known:
            known[number] = whole(grid, number, *more)
        return known[number]

    run.compute_piece, run.refuse_wrong_parts = work, lambda plan: None
    run.run_grid(load_grid("smoke"), folder, METHODS, resume=resume)
    if not pieces.exists():
        pieces.write_bytes(pickle.dumps(known))


def failed(folder: Path, pieces: Path, at: int, fault: str, count: Path) -> int:
    """Run with one operation failing; 0: none did, 2: one sentence was printed, 3: it was
    not.
    """
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch, at, fault, lambda: os.kill(os.getpid(), signal.SIGKILL))
        try:
            smoke(folder, pieces)
        except UserError:
            return 2
        except Exception:
            return 3
    count.write_text(str(disk.count))
    return 0


def alike(one: Path, two: Path) -> int:
    """0: both runs hold the same tables and files; 1: other tables; 2: other files."""
    for kind in ("scenarios", "verdicts"):
        a, b = (
            pq.read_table(f / f"{kind}.parquet")
            .to_pandas()
            .drop(columns="runtime_s", errors="ignore")
            for f in (one, two)
        )
        if not a.equals(b):
            return 1
    return 2 * ({f.name for f in one.iterdir()} != {f.name for f in two.iterdir()})


def main() -> int:
    """Fail the operations, and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", type=int, default=1, help="take every so-manieth operation")
    every, home = parser.parse_args().every, Path(tempfile.mkdtemp())
    pieces, whole, count = home / "pieces", home / "whole", home / "count"
    # this process itself reads no table: what it forks finds no threads of its parent's
    assert apart(lambda: smoke(home / "first", pieces)) == 0
    assert apart(lambda: failed(whole, pieces, -1, "", count)) == 0
    operations = int(count.read_text())
    print(
        f"{operations} file operations\n{'way':12} {'failed':>6} "
        + " ".join(f"{w:>11}" for w in WRONG)
    )
    total = 0
    for fault in FAULTS:
        wrong = dict.fromkeys(WRONG, 0)
        places = range(0, operations, every)
        for at in places:
            folder = home / "run"
            code = apart(
                lambda at=at, fault=fault, folder=folder: failed(folder, pieces, at, fault, count)
            )
            wrong["no sentence"] += code != (-signal.SIGKILL if fault.startswith("kill") else 2)
            resumed = apart(lambda folder=folder: smoke(folder, pieces, resume=True))
            outcome = 1 if resumed else apart(lambda folder=folder: alike(whole, folder))
            wrong["differs"] += outcome not in (0, 2)
            wrong["other files"] += outcome == 2
            shutil.rmtree(folder, ignore_errors=True)
        total += sum(wrong.values())
        print(
            f"{fault:12} {len(places):6} " + " ".join(f"{wrong[w]:11}" for w in WRONG), flush=True
        )
    shutil.rmtree(home)
    return int(total > 0)


if __name__ == "__main__":
    sys.exit(main())

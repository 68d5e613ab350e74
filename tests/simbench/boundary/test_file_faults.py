"""Every file operation of a run failed once, in four ways: nothing is lost, nothing stands half, going on gives the same."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from detectors.errors import UserError
from scenarios.grid import load_grid
from simbench import files
from simbench.bench import pieces as pieces_module
from simbench.bench import run as run_module
from simbench.bench.run import Interrupted, run_grid

SMALL = {"disturbance": "none", "Td_over_T": 0.3, "S_over_2J": 0.5, "Td_over_Ti": 0.05, "periods": 15.0, "repeats": 2}
METHODS = ["horch_histogram"]
FAULTS = ("no space", "i/o", "kill before", "kill after")


class Killed(BaseException):
    """The process is gone: nothing after it runs, no cleaning up either."""


class Disk:
    """Counts what `simbench.files` does to the disk, and lets one operation fail."""

    def __init__(self, patch: pytest.MonkeyPatch, fails: int = -1, fault: str = "") -> None:
        self.count, self.fails, self.fault, self.dead, self.failed = 0, fails, fault, False, False
        replace, unlink, mkdir = Path.replace, Path.unlink, Path.mkdir
        patch.setattr(files, "open", self._open, raising=False)
        patch.setattr(files.os, "fsync", lambda handle: self._do("fsync", lambda: None))
        patch.setattr(Path, "replace", lambda path, target: self._do("replace", lambda: replace(path, target)))
        patch.setattr(Path, "mkdir", lambda path, *a, **k: self._do("mkdir", lambda: mkdir(path, *a, **k)))
        patch.setattr(Path, "unlink", lambda path, *a, **k: None if self.dead else unlink(path, *a, **k))

    def _do(self, name, work):
        if self.dead:
            raise Killed
        self.count += 1
        if self.count - 1 != self.fails:
            return work()
        self.failed = True
        if self.fault == "kill after":
            work()
        if self.fault.startswith("kill"):
            self.dead = True
            raise Killed
        number = errno.ENOSPC if self.fault == "no space" else errno.EIO
        raise OSError(number, os.strerror(number))

    def _open(self, path, mode="r", **more):
        there = Path(path).exists()
        file = open(path, mode, **more)  # noqa: SIM115
        try:
            self._do("open", lambda: None)
        except BaseException:
            file.close()
            if not there and self.fault != "kill after":
                os.unlink(path)
            raise
        write = file.write
        if "w" in mode:
            disk = self

            class Counted:
                def __enter__(self):
                    return self

                def __exit__(self, *what):
                    file.close()

                def write(self, content):
                    def half():
                        return write(content)

                    if disk.count == disk.fails:  # what fails here has written half of it
                        write(content[: len(content) // 2])
                        file.flush()
                    return disk._do("write", half) if len(content) > 5000 else write(content)

                def __getattr__(self, name):
                    return getattr(file, name)

            return Counted()
        return file


@pytest.fixture(scope="module")
def pieces():
    """What the workers of the undisturbed run handed back: simulated once."""
    return {}


@pytest.fixture(scope="module")
def quick(pieces):
    with pytest.MonkeyPatch.context() as patch:
        work = run_module.work

        def known(grid, number, *more):
            if number not in pieces:
                pieces[number] = work(grid, number, *more)
            return pieces[number]

        patch.setattr(run_module, "work", known)
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
    return json.dumps([t.drop([n for n in t.column_names if n == "runtime_s"]).to_pydict() for t in both], default=str)


@pytest.fixture(scope="module")
def whole(quick, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole") / "run"
    run_grid(quick, folder.with_name("first"), METHODS)
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch)
        run_grid(quick, folder, METHODS)
    return folder, disk.count


@pytest.mark.parametrize("fault", FAULTS)
def test_every_file_operation_fails_once(quick, whole, tmp_path, fault):
    expected, operations = tables(whole[0]), whole[1]
    assert operations > 30
    names = {f.name for f in whole[0].iterdir()}
    for n in range(operations):
        folder = tmp_path / f"run{n}"
        with pytest.MonkeyPatch.context() as patch:
            disk = Disk(patch, n, fault)
            try:
                run_grid(quick, folder, METHODS)
            except BaseException as error:
                found = error
            else:
                found = None
        assert disk.failed
        if fault.startswith("kill"):
            assert isinstance(found, (Killed, Interrupted)), n
        else:
            assert isinstance(found, UserError), n
            assert os.strerror(errno.ENOSPC if fault == "no space" else errno.EIO).lower() in str(found)
        for left in [f for f in folder.rglob(f".*.{os.getpid()}") if f.is_file()]:
            left.rename(left.with_suffix(f".{2**22 + 5}"))  # of a process that is gone
        run_grid(quick, folder, METHODS, resume=True)
        assert tables(folder) == expected, n
        assert {f.name for f in folder.iterdir()} == names, n
        shutil.rmtree(folder)


KILLED_FOR_REAL = """
import os, signal, sys
from pathlib import Path
from scenarios.grid import load_grid
from simbench.bench.run import run_grid

left, after = int(sys.argv[2]), sys.argv[3] == "after"
def counted(work):
    def done(*a, **k):
        global left
        left -= 1
        if left == 0 and not after:
            os.kill(os.getpid(), signal.SIGKILL)
        found = work(*a, **k)
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return found
    return done

Path.replace, Path.mkdir, os.fsync = counted(Path.replace), counted(Path.mkdir), counted(os.fsync)
run_grid(load_grid("smoke"), sys.argv[1], ["horch_histogram"], resume=True)
print(-left)
"""


def killed(folder: Path, at: int, when: str) -> subprocess.CompletedProcess:
    words = [sys.executable, "-c", KILLED_FOR_REAL, str(folder), str(at), when]
    return subprocess.run(words, capture_output=True, text=True, timeout=500)


def test_a_whole_smoke_run_is_killed_for_real_and_goes_on(tmp_path):
    undisturbed = killed(tmp_path / "whole", 0, "")
    assert undisturbed.returncode == 0, undisturbed.stderr
    operations, expected = int(undisturbed.stdout), tables(tmp_path / "whole")
    assert operations > 8
    for share, when in ((0.0, "before"), (0.4, "after"), (0.7, "before"), (1.0, "after")):
        folder = tmp_path / f"killed{share}"
        assert killed(folder, 1 + int(share * (operations - 1)), when).returncode == -9
        resumed = killed(folder, 0, "")  # in a process of its own: in this one `quick` answers for every piece
        assert resumed.returncode == 0, resumed.stderr
        assert tables(folder) == expected
        assert {f.name for f in folder.iterdir()} == {f.name for f in (tmp_path / "whole").iterdir()}

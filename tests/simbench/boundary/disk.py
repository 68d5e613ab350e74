"""A disk on which the n-th file operation fails: no space, an I/O error, or a kill before or after
it.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from simbench import files

FAULTS = ("no space", "i/o", "kill before", "kill after")


class Killed(BaseException):
    """The process is gone: nothing after it runs, no cleaning up either."""


class Disk:
    """Counts what `simbench.files` does to the disk, and lets one operation fail; `end` is what a
    kill is.
    """

    def __init__(
        self,
        patch: pytest.MonkeyPatch,
        fails: int = -1,
        fault: str = "",
        end: Callable[[], object] = lambda: None,
    ) -> None:
        self.count, self.fails, self.fault, self.dead, self.failed = 0, fails, fault, False, False
        self.end = end
        replace, unlink, mkdir, rmtree = Path.replace, Path.unlink, Path.mkdir, shutil.rmtree
        patch.setattr(
            shutil, "rmtree", lambda path, *a, **k: None if self.dead else rmtree(path, *a, **k)
        )
        patch.setattr(files, "open", self._open, raising=False)
        patch.setattr(files.os, "fsync", lambda handle: self._do("fsync", lambda: None))
        patch.setattr(
            Path, "replace", lambda path, target: self._do("replace", lambda: replace(path, target))
        )
        patch.setattr(
            Path, "mkdir", lambda path, *a, **k: self._do("mkdir", lambda: mkdir(path, *a, **k))
        )
        patch.setattr(
            Path, "unlink", lambda path, *a, **k: None if self.dead else unlink(path, *a, **k)
        )

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
            self.end()
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

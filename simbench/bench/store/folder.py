"""The folder of a run or a baseline: its files, and the errors about them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simbench.detectors.errors import UserError
from simbench.files import folder as make_folder
from simbench.files import whole_file

TABLE_KINDS = ("verdicts", "scenarios")
PIECES = "receipts"  # key of a manifest: the receipt of each partition of the tables
# what can be done about a damaged piece of a run
AGAIN = "run it again (with --resume, what is damaged alone)"


class RunError(UserError):
    """A run's folder that cannot be used as asked."""


class NoRun(RunError):
    """A folder in which no run stands at all."""


def digest(content: bytes) -> str:
    """Return 16 hex digits that change with any bit of the content."""
    return hashlib.sha256(content).hexdigest()[:16]


def file_digest(path: Path) -> str:
    """Return 16 hex digits of a file, read in blocks."""
    with open(path, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()[:16]


def write_file(file: Path, content: bytes) -> None:
    """Write a file whole, and the folders above it; raises FileError."""
    make_folder(file.parent)
    with whole_file(file, "wb") as f:
        f.write(content)


def visible_names(folder: Path) -> list[str]:
    """Return the names in a folder, sorted, those that begin with a dot left out; none when there
    is no folder.
    """
    if not folder.is_dir():
        return []
    return sorted(f.name for f in folder.iterdir() if not f.name.startswith("."))


def refuse_unfinished(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Raise RunError when a run's manifest does not say that it is whole."""
    if not manifest.get("complete"):
        raise RunError(f"{folder} is not finished; continue the run with --resume")


def partition(number: int) -> str:
    """Return the name of a partition within its table's folder: eight digits, so that names and
    numbers sort alike.
    """
    return f"{number:08d}.parquet"


def partition_file(kind: str, number: int) -> str:
    """Return the name of the file of one table of a piece."""
    return f"{kind}.parquet/{partition(number)}"


def table_files(folder: Path, manifest: Mapping[str, Any], kind: str) -> list[Path]:
    """Return the files a table of a run or baseline is made of, in order; RunError where one is
    missing or too much.
    """
    # a baseline's is one file, a run's a folder
    table = folder / f"{kind}.parquet"
    there = visible_names(table)
    count = len(manifest.get(PIECES, there))
    if not table.is_dir() and count < 2:
        return [table]

    # as many as the manifest states
    needed = [partition(i) for i in range(count)]
    for lacking in sorted(set(needed) - set(there))[:1]:
        raise RunError(
            f"{folder} is damaged: {table.name}/{lacking} is missing, which is needed; restore it,"
            f" or {AGAIN}"
        )
    for other in sorted(set(there) - set(needed))[:1]:
        raise RunError(
            f"{folder} is damaged: {table.name}/{other} is not needed there; remove it, or run it"
            " again"
        )
    return [table / name for name in needed]

"""Write files completely or not at all, and refuse to overwrite what a command reads."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import platform
import re
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any
from zlib import crc32

from simbench.detectors.errors import ParameterError, UserError, masked
from simbench.detectors.record import LoopRecord

if TYPE_CHECKING:
    from pandas import DataFrame

_READ = (
    ".csv",
    ".json",
    ".mat",
    ".parquet",
    ".pq",
    ".toml",
    ".txt",
    ".xls",
    ".xlsx",
)  # what commands read of a folder
# `Path` makes one slash of two; a single letter is a drive
URL = re.compile(r"([A-Za-z][A-Za-z0-9+._-]+(?:::[^/]*)?):/+(.*)")


def _identify_host() -> str:
    """Return what tells this machine, and on it this container and space of process numbers, from
    others.
    """
    space = ""
    with contextlib.suppress(OSError):  # other systems, or processes that may not look, have none
        space = os.readlink("/proc/self/ns/pid")
    return f"{crc32(f'{platform.node()} {os.stat(os.sep).st_dev} {space}'.encode()):08x}"


# bytes; file systems take 255, and a temporary file's name is longer by its machine and process
_LONG_NAME = 200
MOST_BYTES = 300_000_000  # of a file of answers: a million lines take 60 MB
HOST = _identify_host()  # in the names of temporary files: those of other machines are let be
# the name of a file, or a plug-in's text, may be no Unicode
_TEXT: dict[str, Any] = {"encoding": "utf-8", "newline": "", "errors": "backslashreplace"}


# what spreadsheets compute; signed numbers are none, whatever their decimal sign
_STARTS = r"[=@\uff1d\uff20\uff0b\uff0d]|[+-](?![\d.,e+\- ]*(?:$|[;\t\n]))"
# a spreadsheet of many countries splits at semicolons, too, and then takes no quote within a line
# for one: there a quoted line break ends the row
_FORMULA = re.compile(rf"(^|[;\t\n])([\s\"]*)(?={_STARTS})")


class FileError(UserError, OSError):
    """A file or folder that cannot be written."""


@contextlib.contextmanager
def whole_file(path: str | Path, mode: str = "w") -> Iterator[IO]:
    """Open a file for writing that appears under its name only when all of it is on disk."""
    # A special file is written straight, all others beside their name
    path = local_path(path)
    special = path.exists() and not path.is_file()
    if len(os.fsencode(path.name)) < _LONG_NAME:
        name = path.name
    else:
        name = f"{crc32(os.fsencode(path))}"
    if special:
        temporary = path
    else:
        temporary = path.with_name(f".{name}.{HOST}.{os.getpid()}")

    # All of it is on disk before the name is taken
    try:
        if path.is_dir():
            raise IsADirectoryError(21, "it is a folder")
        with open(temporary, mode, **({} if "b" in mode else _TEXT)) as f:
            yield f
            f.flush()
            if not special:
                os.fsync(f.fileno())
        if not special:
            temporary.replace(path)
    except OSError as error:
        raise FileError(
            f"{path} cannot be written: {(error.strerror or str(error)).lower()}"
        ) from error

    # Nothing half is left
    finally:
        if not special:
            with contextlib.suppress(OSError):
                temporary.unlink()


def plain_bytes(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Return the content of a file; ParameterError, before anything is read, for a pipe or device,
    which may have no end, and for a file of more than `most` bytes. OSErrors are the caller's.
    """
    about = os.stat(path)
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(21, "Is a directory", str(path))
    if not stat.S_ISREG(about.st_mode):
        raise ParameterError(f"{path} is a pipe or a device; a file is needed")
    if about.st_size > most:
        raise ParameterError(
            f"{path} has {about.st_size / 1e6:.0f} MB; at most {most / 1e6:.0f} MB are read"
        )
    return Path(path).read_bytes()


def remove_stale_temporaries(place: Path) -> None:
    """Remove what killed processes of this machine left half-written in a folder."""
    for file in place.glob(f".*.{HOST}.*"):
        # an open file of another process cannot be removed on Windows
        with contextlib.suppress(OSError, ValueError):
            if os.name != "posix" or not _process_lives(int(file.suffix[1:])):
                file.unlink()


def _process_lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        return True
    return True


def local_path(path: str | Path) -> Path:
    """Return a path of this machine; FileError for a URL."""
    url = URL.match(str(path))
    if url is not None:
        raise FileError(f"{masked(path)} is a URL; a path on this machine is needed")
    return Path(path)


def picture_kind(path: str | Path) -> str:
    """Return svg, png or pdf, whichever a picture's name asks for; refuse another."""
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in ("svg", "png", "pdf"):
        raise ParameterError(f"picture {path}: .svg, .png or .pdf is needed")
    return kind


def refuse_own_input(
    outputs: Iterable[str | Path | None], inputs: Iterable[str | Path | None]
) -> None:
    """Refuse, before any work, to write over what is read, two things into one file, or where
    nothing can stand.
    """
    # Every file that the command reads
    wanted = [Path(p) for p in outputs if p is not None]
    if not wanted:
        return
    read: set[Path] = set()
    for path in (Path(p) for p in inputs if p is not None):
        if path.is_dir():
            inside = []
            for f in path.rglob("*"):
                if f.suffix.lower() in _READ:
                    inside.append(f)
        else:
            inside = [path]
        read |= {_real_path(f) for f in inside}

    # Each output: not read, not named twice, a place that can be written
    for path in map(local_path, wanted):
        if _real_path(path) in read:
            raise FileError(
                f"{path} is read by this command; it is not written over, name another file"
            )
        if path.is_symlink() and _real_path(path).is_symlink():
            raise FileError(
                f"{path} cannot be written: it is a link that leads back to itself; name another"
                " file"
            )
        if [_real_path(p) for p in wanted].count(_real_path(path)) > 1 and (
            path.is_file() or not path.exists()
        ):
            raise FileError(f"{path} is named for two outputs; each needs another file")
        if path.is_dir() or not path.absolute().parent.is_dir():
            raise FileError(f"{path} cannot be written: it is a folder, or its folder is missing")
        if (path.is_file() or not path.exists()) and not _can_write(path.absolute().parent):
            raise FileError(f"{path} cannot be written: permission denied")
        remove_stale_temporaries(path.absolute().parent)


def _can_write(place: Path) -> bool:
    return os.access(place, os.W_OK, effective_ids=os.access in os.supports_effective_ids)


def _real_path(path: Path) -> Path:
    return Path(os.path.realpath(path))  # `resolve` raises on a link that leads back to itself


def folder(path: str | Path) -> Path:
    """Make a folder, or say in one sentence why it cannot be made."""
    path = local_path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            f"folder {path} cannot be made: {(error.strerror or str(error)).lower()}"
        ) from None
    if not _can_write(path):
        raise FileError(f"folder {path} cannot be written: permission denied")
    return path


def refuse_taken(out: str | Path) -> None:
    """Raise ParameterError where a folder to write is there already, and not empty."""
    there = Path(out)
    if there.exists() and not (there.is_dir() and not any(there.iterdir())):
        raise ParameterError(f"-o {out} exists already; a new or an empty folder is needed")


def write_record(record: LoopRecord, path: str | Path) -> None:
    """Write a record as CSV with columns t_s, sp, op, pv, mv; every number reads back to the same
    bits.
    """
    refuse_kind(path)
    with whole_file(path) as f:
        f.write(record_text(record))


def refuse_kind(path: str | Path) -> None:
    """Refuse the name of another kind of table than the CSV that is written: nobody could read
    it back.
    """
    suffix = Path(path).suffix.lower()
    if suffix in _READ and suffix not in (".csv", ".txt"):
        raise FileError(f"{path}: what is written is CSV; a name that ends in .csv is needed")


def plain_cell(value: Any) -> Any:
    """Return a cell of a table so that no spreadsheet computes it: text that begins like a formula
    gets an apostrophe.
    """
    # which would end a line
    if isinstance(value, str):
        text = value.replace("\r", " ")
    else:
        text = value
    if isinstance(text, str):
        return _FORMULA.sub(lambda m: f"{m[1]}'{m[2]}", text)
    return text


def csv_text(table: DataFrame, **how: Any) -> str:
    """Return a table as CSV without its index, its texts and names by `plain_cell`."""
    texts = {}
    for name in table.select_dtypes(exclude="number"):
        texts[name] = table[name].map(plain_cell)
    return (
        table.assign(**texts)
        .rename(columns=plain_cell)
        .to_csv(index=False, lineterminator="\n", **how)
    )


def write_table(table: DataFrame, path: str | Path, **how: Any) -> None:
    """Write a table as `csv_text` has it, whole or not at all; raises FileError."""
    with whole_file(path) as f:
        f.write(csv_text(table, **how))


def record_text(record: LoopRecord) -> str:
    """Return a record as the text of its CSV file; see `write_record`."""
    columns = {"t_s": record.t, "sp": record.sp, "op": record.op, "pv": record.pv, "mv": record.mv}
    there = {}
    for name, signal in columns.items():
        if signal is not None:
            there[name] = signal.tolist()
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(there)
    writer.writerows(zip(*there.values()))
    return text.getvalue()

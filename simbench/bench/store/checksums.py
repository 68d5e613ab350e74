"""Write and check the checksums of a run's tables and of the manifest that names them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simbench.bench.store.place import Place, place_of
from simbench.detectors.errors import UserError

_CHECKSUM = "checksum"
TABLES = "tables"
TABLE_KINDS = ("verdicts", "scenarios")


class RunError(UserError):
    """A run's folder that cannot be used as asked."""


class NoRun(RunError):
    """A place where no run stands at all."""


def digest(content: bytes) -> str:
    """Return 16 hex digits that change with any bit of the content."""
    return hashlib.sha256(content).hexdigest()[:16]


def file_digest(path: Path) -> str:
    """Return 16 hex digits of a file, read in blocks."""
    with open(path, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()[:16]


def with_checksum(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return JSON content with a checksum over all of it as its last key."""
    plain = {k: v for k, v in content.items() if k != _CHECKSUM}
    return {**plain, _CHECKSUM: _of(plain)}


def without_checksum(content: Mapping[str, Any], where: object) -> dict[str, Any]:
    """Return JSON content without its checksum; raise RunError when it is not what was written."""
    plain = {k: v for k, v in content.items() if k != _CHECKSUM}
    if _CHECKSUM not in content:
        raise RunError(
            f"{where} carries no checksum, which is needed: it was written by an older simbench;"
            " run it again"
        )
    if (mark := _of(plain)) != (stated := content[_CHECKSUM]):
        why = f"its checksum is {mark}, {str(stated)[:16]!r} is needed"
        raise RunError(f"{where} was changed after the run: {why}; run it again, or restore it")
    return plain


def unreadable(file: str, error: OSError) -> RunError:
    """Return the sentence about a file of a run that is there and cannot be read."""
    return RunError(
        f"{file} cannot be read ({error.strerror or error}); a file of the run is needed there:"
        " restore it"
    )


def refuse_unfinished(place: Place, manifest: Mapping[str, Any]) -> None:
    """Raise RunError when a run's manifest does not say that it is whole."""
    if not manifest.get("complete"):
        raise RunError(f"{place} is not finished; continue the run with --resume")


def table_files(place: Place, manifest: Mapping[str, Any], kind: str) -> list[tuple[str, str]]:
    """Return the files a table of a run or baseline is made of, in order, each with its
    checksum.
    """
    marks, table = manifest.get(TABLES, {}).get(kind), f"{kind}.parquet"
    if not isinstance(marks, list):
        return [(table, str(marks))]
    files = [partition(i) for i in range(len(marks))]
    there = place.names(table)
    for lacking in sorted(set(files) - set(there))[:1]:
        raise RunError(
            f"{place} is damaged: {table}/{lacking} is missing, which is needed; restore it, or run"
            " it again"
        )
    for other in sorted(set(there) - set(files))[:1] if manifest.get("complete") else ():
        raise RunError(
            f"{place} is damaged: {table}/{other} is not needed there; remove it, or run it again"
        )
    return [(f"{table}/{name}", mark) for name, mark in zip(files, marks, strict=True)]


def partition(number: int) -> str:
    """Return the name of a partition within its table's folder: eight digits, so that names and
    numbers sort alike.
    """
    return f"{number:08d}.parquet"


def read_verified(place: Place, name: str, mark: str) -> bytes:
    """Return a file's content; raise RunError when it does not have its checksum."""
    try:
        content = place.read(name)
    except FileNotFoundError:
        raise RunError(
            f"{place} is damaged: {name} is missing, which is needed; restore it, or run it again"
        ) from None
    except OSError as error:
        raise unreadable(f"{place}/{name}", error) from None
    if (actual := digest(content)) != mark:
        why = (
            f"is not the table its manifest speaks of: its checksum is {actual}, {mark[:16]!r} is"
            " needed"
        )
        raise RunError(f"{place}/{name} {why}; restore it, or run it again")
    return content


def check_tables(folder: str | Path | Place, manifest: Mapping[str, Any]) -> None:
    """Raise RunError when a table of a run or baseline is not the one its manifest speaks of."""
    place = place_of(folder)
    refuse_unfinished(place, manifest)
    for kind in TABLE_KINDS:
        for name, mark in table_files(place, manifest, kind):
            read_verified(place, name, mark)


def _of(plain: Mapping[str, Any]) -> str:
    # through JSON once: tuples become lists, keys become text, as they will be read
    return digest(json.dumps(json.loads(json.dumps(plain)), sort_keys=True).encode())

"""Every loop record of a folder, of a file with several, or of an ISDB .mat file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from simbench.detectors.errors import ParameterError, RecordError, printable
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_records
from simbench.detectors.records.roles import is_loop

T = TypeVar("T")
RECORD_FILES = (".csv", ".txt", ".parquet", ".xlsx")  # what is read of a folder


def read_folder(
    path: str | Path,
    names: Iterable[str] | None = None,
    each: Mapping[str, Mapping[str, Any]] | None = None,
    loops: str | Path | None = None,
    tag: str | None = None,
    **about: Any,
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop of a folder, of a file with several, or of an ISDB .mat file."""
    path = Path(path)
    given = {k: v for k, v in about.items() if v is not None}
    wanted = None if names is None else set(names)
    sources = _find_sources(path, tag)
    records: dict[str, LoopRecord] = {}
    refused: dict[str, str] = {}
    for name, (file, file_tag) in sources.items():
        if len(sources) > 1 and loops is None and not _is_wanted(name, wanted):
            continue
        stated = {**(each or {}).get(name, {}), **given}
        loaded, not_read = _read_source(file, file_tag, loops, stated)
        if loops is None and len(loaded) + len(not_read) <= 1:
            prefix = None  # the only loop of a file has the file's name
        else:
            prefix = "" if path.is_file() or loops else f"{name} "
        _add(records, loaded, name, prefix)
        _add(refused, not_read, name, prefix)
    if wanted is not None:
        records = {n: r for n, r in records.items() if n in wanted}
    if tag is not None and path.is_dir():
        records = {n: r for n, r in records.items() if is_loop(r.tag, tag)}
        refused = refused if records else {"": f"no column of loop {tag!r} in any file"}
    if not records:
        first = next(iter(refused.values()), "it holds no .csv, .parquet, .xlsx or .mat file")
        raise RecordError(f"{path}: no loop record found ({first})")
    return records, refused


def _find_sources(path: Path, tag: str | None) -> dict[str, tuple[Path, str | None]]:
    """Return by name the files to read, each with the tag of the loop to read of it."""
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.isdb import read_loops

        return {name: (path, name) for name in read_loops(path)}
    if path.is_file():
        return {printable(path.stem): (path, tag)}
    if not path.is_dir():
        raise RecordError(f"folder {path} does not exist")
    # a tag given for many files picks a loop that their columns name, and names none
    files = [f for f in sorted(path.iterdir()) if f.suffix.lower() in RECORD_FILES]
    return {name: (f, None) for name, f in zip(_names(files), files, strict=True)}


def _is_wanted(name: str, wanted: set[str] | None) -> bool:
    """Return whether a file, or a loop of it, is among those that are wanted; None: all are."""
    return wanted is None or any(w == name or w.startswith(f"{name} ") for w in wanted)


def _read_source(
    file: Path, tag: str | None, loops: str | Path | None, stated: Mapping[str, Any]
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read the loops of one file; of what cannot be read in any way, the sentence."""
    try:
        return read_records(file, tag=tag, loops=loops, **stated)
    except ParameterError:  # an option that is wrong of every file
        raise
    except Exception as error:
        return {}, {printable(file.stem): printable(sentence_of(error))}


def _add(found: dict[str, T], more: Mapping[str, T], name: str, prefix: str | None) -> None:
    """Add what one file gave, each by its label after the prefix, or by the file's name."""
    for label, value in more.items():
        key = name if prefix is None else f"{prefix}{label}"
        found[key if key not in found else f"{name} {label}"] = value


def _names(files: Sequence[Path]) -> list[str]:
    """Return a name for each file: its stem where no other has it, else with its ending, and
    numbered where two look alike even with it.
    """
    alike = Counter(printable(f.stem) for f in files)
    names: list[str] = []
    for f in files:
        name = printable(f.stem if alike[printable(f.stem)] == 1 else f.name)
        names.append(name if name not in names else f"{name} ({len(names)})")
    return names

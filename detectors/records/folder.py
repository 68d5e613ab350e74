"""Read every loop record of a folder, and what a table of labels says of them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from simbench.detectors.errors import ParameterError, RecordError, nearest, printable
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import KIND_ALIASES, KINDS, PROCESSES, LoopRecord, hyphenated
from simbench.detectors.records.columns import choose_loop
from simbench.detectors.records.files import read_texts
from simbench.detectors.records.io import read_records

RECORD_FILES = (".csv", ".txt", ".parquet", ".xlsx")  # what is read of a folder
_LABELS = ("stiction", "no_stiction", "unknown")
# what a loop without stiction may have instead; more words may follow ("tuning problem")
_CAUSES = (
    "tuning",
    "disturbance",
    "load",
    "interaction",
    "sensor",
    "nonlinearity",
    "quantisation",
) + ("healthy", "other")


def read_folder(
    path: str | Path,
    names: Iterable[str] | None = None,
    each: Mapping[str, Mapping[str, Any]] | None = None,
    loops: str | Path | None = None,
    tag: str | None = None,
    **about: Any,
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop of a folder, or of a file, as far as it is among the `names`, with what is
    known of `each`; of what is refused the sentence.
    """
    # a file, or those of a folder by stem, with the ending where two have the same
    path = Path(path)
    if path.is_dir():
        files = []
        for file in sorted(path.iterdir()):
            if file.suffix.lower() in RECORD_FILES:
                files.append(file)
    else:
        files = [path]
    alike = Counter(printable(file.stem) for file in files)

    # each loop by its tag after the name of its file, or by that name where it is the only one
    records: dict[str, LoopRecord] = {}
    refused: dict[str, str] = {}
    for number, file in enumerate(files):
        name = printable(file.stem if alike[printable(file.stem)] == 1 else file.name)
        if name in records:
            name = f"{name} ({number})"
        asked = names is None or any(f"{one} ".startswith(f"{name} ") for one in names)
        if not (asked or loops or file is path):
            continue
        try:
            found = read_records(file, tag=tag if file is path else None, loops=loops, **about)
        except Exception as error:
            if file is path or isinstance(error, ParameterError):  # wrong of every file
                raise
            found = {}, {name: printable(sentence_of(error))}
        only = path.is_dir() and not loops and len(found[0]) + len(found[1]) == 1
        for kept, more in zip((records, refused), found, strict=True):
            if path.is_dir() and not loops:
                before = f"{name} "
            else:
                before = ""
            kept |= {name if only else f"{before}{label}": value for label, value in more.items()}

    # those that are asked for, with what is known of them
    if names is not None:
        records = {name: record for name, record in records.items() if name in names}
    if tag is not None and path.is_dir():
        records = {n: r for n, r in records.items() if choose_loop(tag, [r.tag])}
        refused = {} if not records else refused
    for name in records.keys() & (each or {}).keys():
        known = {}
        for k, v in each[name].items():
            if v and about.get(k) is None:
                known[k] = v
        records[name] = replace(records[name], **known)
    if not records:
        if tag and path.is_dir():
            lacks = f"no column of loop {tag!r} in any file"
        else:
            lacks = ""
        first = next(iter(refused.values()), lacks or "it holds no file of a record")
        raise RecordError(f"{path}: no loop record found ({first})")
    return records, refused


def read_labels(path: str | Path) -> dict[str, dict[str, str]]:
    """Read a table of labels, one row per record."""
    # one row per record
    columns = {name.strip().lower(): cells for name, cells in read_texts(path).columns.items()}
    key = next((k for k in ("id", "record") if k in columns), None)
    if key is None or "label" not in columns:
        needed = f"{path}: a table of labels needs the columns id (or record) and label"
        raise RecordError(f"{needed}; it has {', '.join(columns):.200}")

    # each row with words that are known; a misspelt "stiction" would count as its opposite
    labels = {}
    for k, cells in enumerate(zip(*columns.values(), strict=True)):
        row = {}
        for name, cell in zip(columns, cells, strict=True):
            row[name] = cell.strip()
        kind = hyphenated(row.get("kind") or row.get("type", ""))
        process = hyphenated(row.get("process") or row.get("dynamics", ""))
        row["kind"] = kind if KIND_ALIASES.get(kind, kind) in KINDS else ""
        row["process"] = process if process in PROCESSES else ""
        row["loop"] = row.get("loop") or row[key]
        row["unit_group"] = row.get("unit_group") or row["loop"]
        text = row["label"]
        row["label"] = "_".join(re.findall(r"[a-z]+", text.lower()))
        if row["label"] and row["label"] not in _LABELS and not row["label"].startswith(_CAUSES):
            known = nearest(row["label"], _LABELS + _CAUSES)
            raise RecordError(f"{path}, line {k + 2}: label {text[:60]!r} is unknown, {known}")
        labels[row[key]] = row
    return labels

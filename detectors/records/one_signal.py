"""Join files that hold one signal of a loop each, as their names tell: FIC707.PV.csv, FIC707.OP.csv
and FIC707.SP.csv are the record of FIC707.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from simbench.detectors.errors import RecordError
from simbench.detectors.records.historian import is_head, take_rows, take_units
from simbench.detectors.records.long_table import PART_TIME, is_stamped
from simbench.detectors.records.roles import find_loops, find_time, is_quality, parse, tag_number
from simbench.detectors.records.tables import BLANK, Sheet, read_sheets


@dataclass(frozen=True)
class SignalFiles:
    """The files of one loop's signals."""

    tag: str
    files: tuple[Path, ...]  # that of PV first


@dataclass(frozen=True)
class Joined:
    """The tables of such files by the file's name, and the units of their values."""

    tag: str
    parts: dict[str, Sheet]
    units: dict[str, str]
    notes: tuple[str, ...]


def signal_files(files: Sequence[Path]) -> list[SignalFiles]:
    """Return the loops of which PV and OP have a file each; what the files hold is not read."""
    groups: dict[tuple[str, str], list[Path]] = {}
    for file in files:
        name = parse(file.stem)
        if name.role is not None and name.loop:
            key = tag_number(name.loop) or " ".join(name.loop), file.suffix.lower()
            groups.setdefault(key, []).append(file)
    found = []
    for group in groups.values():
        by_stem = {file.stem: file for file in group}
        try:
            loops = find_loops(list(by_stem), {}, "")
        except RecordError:  # names that leave open which is which join nothing
            continue
        for tag, roles in loops.items():
            if tag and {"pv", "op"} <= set(roles):
                stems = dict.fromkeys([roles["pv"], *roles.values()])
                found.append(SignalFiles(tag, tuple(by_stem[stem] for stem in stems)))
    return found


def join(path: Path) -> Joined | None:
    """Read a file with those of the other signals of its loop, which lie beside it; None where it
    has none, or one of them holds more than a signal.
    """
    if parse(path.stem).role is None or not path.is_file():
        return None
    beside = [f for f in sorted(path.parent.iterdir()) if f.suffix.lower() == path.suffix.lower()]
    loop = next((one for one in signal_files(beside) if path in one.files), None)
    if loop is None:
        return None
    parts = {}
    units = {}
    notes = [f"files: {', '.join(file.name for file in loop.files)} are one record"]
    for file in loop.files:
        try:
            read = _only_signal(file)
        except RecordError:  # of the file alone, the sentence is given where it is read
            return None
        if read is None:
            return None
        part, units[file.stem] = read
        notes += [f"{file.name}: {note}" for note in part.notes]
        parts[file.stem] = replace(part, notes=[])
    return Joined(loop.tag, parts, units, tuple(notes))


def _only_signal(file: Path) -> tuple[Sheet, str] | None:
    """Return the times and values of a file under its name, and the unit; None where it holds no
    times, or not one signal.
    """
    sheets = [*read_sheets(file, lambda cells: is_head(cells, {})).values()]
    if len(sheets) != 1:
        return None
    sheet = sheets[0]
    take_rows(sheet, {})
    units = take_units(sheet, {})
    time = find_time(list(sheet.columns), {}, str(file)) or next(
        (name for name, cells in sheet.columns.items() if is_stamped(cells)), None
    )
    values = [
        name
        for name in sheet.columns
        if name != time and not is_quality(name) and not name.startswith(BLANK)
    ]
    if time is None or len(values) != 1:
        return None
    quality = {name: name for name in sheet.columns if is_quality(name) and name != time}
    rows = range(len(sheet.columns[time]))
    part = sheet.part({PART_TIME: time, file.stem: values[0], **quality}, rows)
    part.notes += sheet.notes
    return part, units.get(values[0], "")

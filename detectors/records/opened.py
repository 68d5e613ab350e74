"""A file opened: its tables with the units of their columns, before any loop is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from simbench.detectors.errors import RecordError
from simbench.detectors.records.clock import is_stamped
from simbench.detectors.records.dialects import entries, words
from simbench.detectors.records.gaps import SHORTEST
from simbench.detectors.records.historian import (
    drop_quality,
    is_head,
    is_long,
    take_rows,
    take_units,
)
from simbench.detectors.records.roles import (
    ASKED,
    LAYOUT,
    NONE,
    is_time,
    parse,
    plain,
    shown,
    words_of,
)
from simbench.detectors.records.tables import BLANK, Sheet, range_of, read_sheets

_MILLISECONDS = entries("millitm, millisecond, milliseconds, msec, ms")


@dataclass
class OpenedTable:
    """A file's table with the units of its columns; `about` is what the file states."""

    sheet: Sheet
    units: dict[str, str]
    where: str
    about: dict[str, Any] = field(default_factory=dict)

    def with_separate_notes(self) -> OpenedTable:
        """Return the same with separate notes, for one of several loops."""
        return replace(self, sheet=replace(self.sheet, notes=[*self.sheet.notes]))


def open_tables(path: Path, chosen: Mapping[str, str], tag: str | None) -> dict[str, OpenedTable]:
    """Return a file's table, of a workbook with several those of its sheets by name, or the one
    that a tag names.
    """
    where = str(path)
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.isdb import read_loop

        cells, about = read_loop(path, tag)
        return {"": OpenedTable(Sheet(cells), {}, where, about)}
    given = [name for name in chosen.values() if name.lower() != NONE]
    counted = bool(given) and all(name.isdigit() for name in given)
    sheets = read_sheets(path, lambda cells: is_head(cells, chosen), counted)
    if len(sheets) > 1 and tag is not None:
        sheets = {n: s for n, s in sheets.items() if plain(n) == plain(tag)} or sheets
    several = len(sheets) > 1
    out = {}
    for name, sheet in sheets.items():
        table = open_sheet(sheet, chosen, where)
        if loops := {} if several else _split_by_loop(sheet):
            return {loop: replace(table, sheet=part) for loop, part in loops.items()}
        out[name if several else ""] = table
    return out


def open_sheet(sheet: Sheet, chosen: Mapping[str, str], where: str) -> OpenedTable:
    """Return a table of samples alone: without rows and columns that are something else, its dates
    whole; another layout is refused.
    """
    take_rows(sheet, chosen)
    units = take_units(sheet, chosen)
    _join_dates(sheet)
    _refuse_other_layout(sheet, chosen, where)
    drop_quality(sheet, chosen, where)
    return OpenedTable(sheet, units, where)


def _refuse_other_layout(sheet: Sheet, chosen: Mapping[str, str], where: str) -> None:
    """Refuse a table of a row per time and tag, and one whose signals have times of their own."""
    # the tag of every value in a column of its own
    names = list(sheet.columns)
    roles = {parse(name).role for name in names} | set(chosen)
    if is_long(names) and not {"pv", "op"} <= roles:
        raise RecordError(f"{where}: a row per time and tag; {LAYOUT} pivot_table")

    # a time before each signal, or under its name
    times = [n for n in names if is_time(n) or is_stamped(sheet.columns[n])]
    after = [names[i + 1] for i in range(len(names) - 1) if names[i] in times]
    if any({"pv", "op"} <= {parse(name).role for name in among} for among in (times, after)):
        raise RecordError(f"{where}: signals with times of their own; {LAYOUT} merge_asof")


def _split_by_loop(sheet: Sheet) -> dict[str, Sheet]:
    """Take a table apart by loop in which every row names its loop beside the values of its
    signals; empty where none does.
    """
    named = {n: parse(n) for n in sheet.columns}
    if not {"pv", "op"} <= {p.role for p in named.values() if not p.loop}:
        return {}
    for column in (n for n in named if words_of(n) in words("tag")):
        rows: dict[str, list[int]] = {}
        for i, cell in enumerate(sheet.columns[column]):
            rows.setdefault(str(cell).strip(), []).append(i)
        if 1 < len(rows) and min(map(len, rows.values())) >= SHORTEST:
            kept = {n: n for n in sheet.columns if n != column}
            return {loop: sheet.part(kept, mine) for loop, mine in rows.items()}
    return {}


def with_ranges(error: RecordError, table: OpenedTable) -> RecordError:
    """Return a refusal that asks which column is what with the columns and their ranges; any other
    as it is.
    """
    if f"={ASKED}" not in error.cure:
        return error
    cells = table.sheet.columns.items()
    ranges = [f"{n[:60]} ({range_of(c)})" for n, c in cells if not n.startswith(BLANK)]
    return RecordError(f"{error.sentence}; columns are: {shown(ranges, 90)}", error.cure)


def _join_dates(sheet: Sheet) -> None:
    """Join a column of dates and one of clock times, in both."""
    low = {plain(n): n for n in sheet.columns}
    date, clock = (
        next((low[w] for w in among if w in low), None) for among in (words("date"), words("clock"))
    )
    dates = sheet.columns.get(date or "")
    clocks = sheet.columns.get(clock or "")
    if not date or not clock or not isinstance(dates, list) or not isinstance(clocks, list):
        return
    if any(re.search(r"\d[-/.]\w+[-/.]\d", str(c)) for c in clocks[:1]):
        return  # it holds the date already
    if (
        parts := next((sheet.columns[low[w]] for w in _MILLISECONDS if w in low), None)
    ) is not None:
        clocks = [
            f"{c}.{int(ms):03d}" if str(ms).isdigit() else c
            for c, ms in zip(clocks, parts, strict=True)
        ]
    sheet.columns[date] = sheet.columns[clock] = [
        f"{str(d).strip().split(' ')[0]} {str(c).strip()}"
        for d, c in zip(dates, clocks, strict=True)
    ]

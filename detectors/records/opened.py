"""A file opened: its tables with the units of their columns, before any loop is read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from simbench.detectors.errors import RecordError, nearest
from simbench.detectors.records.dialects import entries, words
from simbench.detectors.records.historian import is_head, take_rows, take_units
from simbench.detectors.records.long_table import by_loop, unfold
from simbench.detectors.records.one_signal import join
from simbench.detectors.records.roles import ASKED, NONE, QUALITY_OF, plain, shown
from simbench.detectors.records.tables import BLANK, Sheet, range_of, read_sheets

_MILLISECONDS = entries("millitm, millisecond, milliseconds, msec, ms")


@dataclass
class OpenedTable:
    """A file's table with the units of its columns and, where signals have separate times, a
    part per tag; `loop` is the tag of one whose signals have a file each, `about` what the file
    states.
    """

    sheet: Sheet
    units: dict[str, str]
    parts: dict[str, Sheet] | None
    where: str
    loop: str = ""
    about: dict[str, Any] = field(default_factory=dict)

    def with_separate_notes(self) -> OpenedTable:
        """Return the same with separate notes, for one of several loops."""
        parts = self.parts and {name: replace(p, notes=[]) for name, p in self.parts.items()}
        return replace(self, sheet=replace(self.sheet, notes=[*self.sheet.notes]), parts=parts)


def open_tables(path: Path, chosen: Mapping[str, str], tag: str | None) -> dict[str, OpenedTable]:
    """Return a file's table, of a workbook with several those of its sheets by name, or the one
    that a tag names.
    """
    where = str(path)
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.isdb import read_loop

        cells, about = read_loop(path, tag)
        return {"": OpenedTable(Sheet(cells), {}, None, where, about["tag"], about)}
    if not chosen and (joined := join(path)) is not None:
        sheet = Sheet({}, notes=[*joined.notes])
        return {"": OpenedTable(sheet, joined.units, joined.parts, where, joined.tag)}
    given = [name for name in chosen.values() if name.lower() != NONE]
    counted = bool(given) and all(name.isdigit() for name in given)
    sheets = read_sheets(path, lambda cells: is_head(cells, chosen), counted)
    if len(sheets) > 1 and tag is not None:
        sheets = {n: s for n, s in sheets.items() if plain(n) == plain(tag)} or sheets
    several = len(sheets) > 1
    out = {}
    quality = chosen.get(QUALITY_OF, "none")
    for name, sheet in sheets.items():
        if quality.lower() != "none" and quality not in sheet.columns:
            known = nearest(quality, sheet.columns)
            raise RecordError(f"{where}: no column {quality!r} for quality, {known}")
        take_rows(sheet, chosen)
        units = take_units(sheet, chosen)
        join_dates(sheet)
        if loops := {} if several else by_loop(sheet):
            return {loop: OpenedTable(part, units, None, where) for loop, part in loops.items()}
        out[name if several else ""] = OpenedTable(sheet, units, unfold(sheet, quality), where)
    return out


def with_ranges(error: RecordError, table: OpenedTable) -> RecordError:
    """Return a refusal that asks which column is what with the columns and their ranges; any other
    as it is.
    """
    if f"={ASKED}" not in error.cure:
        return error
    cells = table.sheet.columns
    if table.parts:
        # of a part: its times, its values, and a quality
        cells = {name: list(part.columns.values())[1] for name, part in table.parts.items()}
    ranges = [f"{n[:60]} ({range_of(c)})" for n, c in cells.items() if not n.startswith(BLANK)]
    return RecordError(f"{error.sentence}; columns are: {shown(ranges, 90)}", error.cure)


def join_dates(sheet: Sheet) -> None:
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

"""Read tables whose signals have separate times: one row per time, tag and value, or a column of
times next to every signal.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from simbench.detectors.records.clock import seconds
from simbench.detectors.records.dialects import words
from simbench.detectors.records.gaps import SHORTEST
from simbench.detectors.records.historian import long_columns, read_numbers
from simbench.detectors.records.mode import mode
from simbench.detectors.records.quality_column import apply_quality
from simbench.detectors.records.roles import ends_with, is_quality, is_time, parse, words_of
from simbench.detectors.records.tables import BLANK, Sheet

_STAMP = re.compile(r"\d{1,4}[-/.]\w{1,9}[-/.]\d{2,4}|\d:\d\d")
PART_TIME = "t"  # the column of times in a part


def unfold(sheet: Sheet, quality: str = "") -> dict[str, Sheet] | None:
    """Take a table apart whose signals have separate times, tag by tag; None where they share
    one. `quality` is the name of a column that is one, besides those whose names say so.
    """
    names = list(sheet.columns)
    columns = long_columns(names)
    if columns is not None and not {"pv", "op"} <= {parse(n).role for n in names}:
        return _split_by_tag(sheet, *columns, quality)
    return _split_pairs(sheet, quality)


def by_loop(sheet: Sheet) -> dict[str, Sheet]:
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


def read_series(
    part: Sheet, role: str, where: str, chosen: Mapping[str, str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (s) and values of one tag, what is missing left out; of a mode the words in
    place of numbers.
    """
    name = next(n for n in part.columns if n != PART_TIME and not is_quality(n))
    t = seconds(
        part.columns[PART_TIME],
        f"time of {name}",
        where,
        place=part.place,
        notes=part.notes,
        again=True,
    )
    if role == "mode":
        cells = mode(part.columns[name])
        return (t, cells) if t[0] <= t[-1] else (t[::-1], cells[::-1])
    signal = {role: read_numbers(part, [name], where)[name]}
    apply_quality(part, {role: name}, signal, where, chosen)
    x = signal[role]
    if t.size and t[0] > t[-1]:
        t = t[::-1]
        x = x[::-1]
    known = np.isfinite(x)
    last = np.append(np.diff(t) > 0, True)  # of two values at one time the later one holds
    return t[known & last], x[known & last]


def _split_by_tag(
    sheet: Sheet, time: str, tags: list[str], value: str, quality: str
) -> dict[str, Sheet]:
    cells = [sheet.columns[name] for name in tags]
    tag_of_row = [str(v).strip() for v in cells[0]]
    if len(tags) > 1 and not {"pv", "op"} <= {parse(n).role for n in set(tag_of_row)}:
        tag_of_row = [f"{a}.{str(b).strip()}" for a, b in zip(tag_of_row, cells[1], strict=True)]
    rows: dict[str, list[int]] = {}
    for i, name in enumerate(tag_of_row):
        rows.setdefault(name, []).append(i)
    others = [n for n in sheet.columns if n not in (time, value, *tags)]
    also = {n: n for n in others if is_quality(n) or n == quality}
    return {
        name: sheet.part({PART_TIME: time, name or "value": value, **also}, mine)
        for name, mine in rows.items()
    }


def _split_pairs(sheet: Sheet, quality: str) -> dict[str, Sheet] | None:
    """Take apart a table that has a column of times before every signal, as PI DataLink writes
    compressed data.
    """
    names = list(sheet.columns)
    times = [
        n
        for n, cells in sheet.columns.items()
        if is_stamped(cells) or (is_time(n) and not n.startswith(BLANK))
    ]
    parts: dict[str, Sheet] = {}
    for time in times:
        at = names.index(time) + 1
        value = names[at] if at < len(names) and names[at] not in times else None
        if value is None:
            return None
        # FIC101.PV.Time names its signal too
        of_time = ".".join(ends_with(time, words("time")) or ())
        name = next((n for n in (value, time, of_time) if parse(n).role is not None), None)
        if name is None or name in parts:
            return None
        there = [
            i
            for i, c in enumerate(sheet.columns[time])
            if str(c if c is not None else "").strip() not in ("", "NaT")
        ]
        after = {n: n for n in names[at + 1 : at + 2] if is_quality(n) or n == quality}
        parts[name] = sheet.part({PART_TIME: time, name: value, **after}, there)
    return parts if len(parts) > 1 and {"pv", "op"} <= {parse(n).role for n in parts} else None


def is_stamped(cells: list | np.ndarray) -> bool:
    """Whether a column begins with a time stamp."""
    if isinstance(cells, np.ndarray):
        return cells.dtype.kind == "M"
    first = next((str(c).strip() for c in cells if c is not None and str(c)), "")
    return bool(_STAMP.search(first))

"""Read a CSV, parquet or Excel file as named columns, wherever in the file the table begins."""

from __future__ import annotations

import csv
import gc
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.dialects import entries

BLANK = "\0"  # begins the name of a column that has none
MOST_ROWS = 1_000_000  # of a sheet
MOST_PARQUET_ROWS, MOST_PARQUET_BYTES = (
    10_000_000,
    1_000_000_000,
)  # a year of 3 s samples; bytes without compression
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"  # begins a compound file, as which Excel encrypts, too
MOST_UNPACKED = 300_000_000  # bytes of an Excel file's parts

Columns = dict[str, list | np.ndarray]
_DELIMITERS = ",;\t|"
_PREAMBLE = 60  # lines in which the header is looked for
_OFTEN = entries("""
    time, timestamp, datetime, date, value, zeit, zeitstempel, horodatage, fecha, quality,
    qualitycode, qc, status, confidence, validity
""")


@dataclass
class Sheet:
    """A table as its file holds it."""

    columns: Columns  # cells by name
    # of the file of each row; empty where a file has none
    lines: list[int] = field(default_factory=list)
    delimiter: str = ""  # between the cells of a CSV
    notes: list[str] = field(default_factory=list)  # what had to be done to read it

    def place(self, row: int) -> str:
        """Return the line of a row in its file."""
        return f"line {self.lines[row] if self.lines else row + 2}"

    def part(self, names: Mapping[str, str], rows: Sequence[int]) -> Sheet:
        """Return some rows of some columns, each under a new name, without the notes."""
        index = np.array(rows, dtype=np.intp)
        cells = {new: self.columns[name] for new, name in names.items()}
        columns: Columns = {
            n: c[index] if isinstance(c, np.ndarray) else [c[i] for i in rows]
            for n, c in cells.items()
        }
        return Sheet(columns, [self.lines[i] for i in rows] if self.lines else [], self.delimiter)


def read_table(path: Path) -> Columns:
    """Read a table whose first line names its columns, its cells as they stand."""
    return read_sheet(path).columns


def read_sheet(path: Path) -> Sheet:
    """Read a table whose first line names its columns, with the lines on which its rows stand."""
    return next(iter(read_sheets(path, lambda cells: False).values()))


def read_sheets(path: Path, is_head: Callable[[Sequence[str]], bool]) -> dict[str, Sheet]:
    """Read the tables of a file by name: of a workbook every sheet with a header, or the first;
    else the only one.
    """
    if not path.exists():
        raise RecordError(f"file {path} does not exist")
    if not path.is_file():
        raise RecordError(f"{path} is no file; a table of a record is needed")
    if path.stat().st_size == 0:
        raise RecordError(f"file {path} is empty; a header line and one line per sample are needed")
    suffix = path.suffix.lower()
    try:
        if suffix in (".parquet", ".pq"):
            return {"": Sheet(_from_frame(_parquet(path)))}
        if suffix in (".xlsx", ".xls"):
            sheets = _workbook(path)
            whose = [
                name for name, rows in sheets.items() if any(map(is_head, rows[:_PREAMBLE]))
            ] or list(sheets)[:1]
            return {
                n: _table(path, sheets[n], list(range(1, len(sheets[n]) + 1)), is_head)
                for n in whose
            }
    except RecordError:
        raise
    except ImportError:
        raise RecordError(
            f"file {path} is a workbook, and openpyxl, which reads it, is not installed: pip"
            " install 'stiction-simbench[excel]', or save it as CSV"
        ) from None
    except Exception as error:  # pandas passes on whatever its engine raises
        message = str(error).partition("\n")[0].partition(", you must")[0]  # advice to programmers
        raise RecordError(
            f"file {path} cannot be read as {suffix[1:]}: {message}; a whole file is needed"
        ) from error
    collecting = gc.isenabled()
    gc.disable()  # a million rows, none of them garbage, would be looked through again and again
    try:
        return {"": _csv(path, is_head)}
    finally:
        if collecting:
            gc.enable()


def range_of(cells: Sequence[object]) -> str:
    """Return the range of a column's numbers, or that it holds none."""
    numbers = []
    for cell in cells:
        try:
            numbers.append(float(str(cell).replace(",", ".")))
        except ValueError:
            continue
    kept = [x for x in numbers if np.isfinite(x)]
    return f"{min(kept):.4g} to {max(kept):.4g}" if len(kept) > len(cells) / 2 else "no numbers"


def parquet_sizes(file: Any) -> tuple[int, int]:
    """Return the rows of an open parquet file, and the bytes that it takes once it is read, by its
    footer alone.
    """
    about = file.metadata
    groups = [about.row_group(i) for i in range(about.num_row_groups)]
    # a value that repeats takes no room in the file, and 8 bytes once it is read
    values = sum(g.column(j).num_values for g in groups for j in range(g.num_columns))
    return about.num_rows, max(sum(g.total_byte_size for g in groups), 8 * values)


def _parquet(path: Path) -> Any:
    """Read a parquet file as a frame; a large one is refused by its footer, before anything is
    unpacked.
    """
    from pyarrow.parquet import ParquetFile, read_table

    file = ParquetFile(path)
    rows, size = parquet_sizes(file)
    if rows > MOST_PARQUET_ROWS:
        raise RecordError(f"file {path} has {rows} rows; at most {MOST_PARQUET_ROWS} are read")
    if size > MOST_PARQUET_BYTES:
        limit = f"at most {MOST_PARQUET_BYTES / 1e6:.0f} MB are read"
        raise RecordError(f"file {path} unpacks to {size / 1e6:.0f} MB; {limit}")
    # a text that repeats is kept once
    texts = [
        c.path
        for c in map(file.schema.column, range(file.metadata.num_columns))
        if c.physical_type == "BYTE_ARRAY"
    ]
    return read_table(path, read_dictionary=texts).to_pandas()


def _workbook(path: Path) -> dict[str, list[list[str]]]:
    """Read the cells of every sheet; a small file that unpacks to a large one is refused before it
    fills the memory.
    """
    import pandas as pd

    with open(path, "rb") as f:
        if f.read(4) == _OLD_EXCEL:
            raise RecordError(
                f"file {path} is a workbook of an old Excel, or one with a password; one saved as"
                " .xlsx without a password is needed"
            )
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as packed:
            size = sum(item.file_size for item in packed.infolist())
        if size > MOST_UNPACKED:
            raise RecordError(
                f"file {path} unpacks to {size / 1e6:.0f} MB; at most {MOST_UNPACKED / 1e6:.0f} MB"
                " are read"
            )
    frames = pd.read_excel(path, header=None, dtype=object, nrows=MOST_ROWS + 2, sheet_name=None)
    if max(map(len, frames.values())) > MOST_ROWS + 1:
        raise RecordError(f"file {path} has more than {MOST_ROWS} rows; at most that many are read")
    return {
        n: [[_cell(v) for v in row] for row in f.itertuples(index=False, name=None)]
        for n, f in frames.items()
    }


def _from_frame(frame) -> Columns:
    frame = frame.reset_index() if frame.index.dtype.kind == "M" or frame.index.name else frame
    return {
        str(c): frame[c].to_numpy() if frame[c].dtype.kind in "fiuM" else _texts(frame[c])
        for c in frame.columns
    }


def _texts(column) -> list:
    if column.dtype == "category":
        kept = [*column.cat.categories, None]  # code -1 is a missing value
        return [kept[code] for code in column.cat.codes]
    return [None if missing else v for v, missing in zip(column, column.isna(), strict=True)]


def _cell(value: object) -> str:
    if value is None or value != value:  # NaN, NaT
        return ""
    return value.isoformat(sep=" ") if isinstance(value, datetime) else str(value)


def _decoded(path: Path) -> tuple[str, list[str]]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"file {path} cannot be read: {error.strerror}") from error
    head = data[:4096]
    wide = [len(half) > 8 and half.count(0) > 0.4 * len(half) for half in (head[0::2], head[1::2])]
    marked = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in head and not marked and (wide[0] == wide[1] or head[wide[0] :: 2].count(0)):
        raise RecordError(
            f"file {path} is binary; a text table (CSV), .parquet, .xlsx or .mat is needed"
        )
    if marked or b"\0" in head:
        code = "utf-16" if marked else "utf-16-be" if wide[0] else "utf-16-le"
        try:
            return data.decode(code), []
        except UnicodeDecodeError as error:
            raise RecordError(
                f"file {path} is damaged UTF-16 text (byte {error.start}); whole ones are needed"
            ) from error
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError as error:
        chinese = data.decode("gb18030", errors="replace")
        if re.search("时间|日期|位号|测量值|设定值|输出", chinese[:4096]):
            return chinese, [f"file: byte {error.start} is not UTF-8, read as GB 18030"]
        note = (
            f"file: byte {error.start} is not UTF-8, read as Windows-1252; numbers are the same in"
            " both"
        )
        return data.decode("cp1252", errors="replace"), [note]


def _csv(path: Path, is_head: Callable[[Sequence[str]], bool]) -> Sheet:
    """Read text by the delimiter under which a line names the signals; pandas' sniffer guesses, and
    gives no note.
    """
    text, notes = _decoded(path)
    lines = text.splitlines()
    start, head, above = 0, lines[0] if lines else "", []
    delimiter = max(_DELIMITERS, key=head.count)
    for i, line in enumerate(lines[:_PREAMBLE]):
        fit = [
            d
            for d in _DELIMITERS
            if d in line and is_head(next(_cells(path, [line], d), ([], 0))[0])
        ]
        if fit:
            start, delimiter = i, max(fit, key=line.count)
            above = (
                next(_cells(path, [lines[i - 1]], delimiter), ([], 0))[0]
                if i and lines[i - 1][:1] != "#"
                else []
            )
            break
    # columns apart by spaces
    if not any(d in line for line in lines[:_PREAMBLE] for d in _DELIMITERS):
        start = next((i for i, line in enumerate(lines[:_PREAMBLE]) if is_head(line.split())), -1)
        lines = (
            [*lines[:start], *(" ".join(line.split()) for line in lines[start:])]
            if start >= 0
            else lines
        )
        start, delimiter = max(start, 0), " " if start >= 0 else delimiter
    rows, numbers = [], []
    for cells, line in _cells(path, lines[start:], delimiter):
        if cells and cells != [""]:
            rows.append(cells)
            numbers.append(start + line)
    sheet = _table(path, rows, numbers, lambda cells: True, above)
    skipped = sum(bool(line.strip()) for line in lines[:start])
    sheet.notes = (
        notes + [f"file: {skipped} lines above the header left out"] * (skipped > 0) + sheet.notes
    )
    sheet.delimiter = delimiter
    return sheet


def _cells(path: Path, lines: list[str], delimiter: str) -> Iterator[tuple[list[str], int]]:
    rows = csv.reader(lines, delimiter=delimiter)
    try:
        for row in rows:
            yield row, rows.line_num
    except csv.Error as error:
        raise RecordError(
            f"{path}, line {rows.line_num}: {error}; shorter cells are needed"
        ) from error


def _table(
    path: Path,
    rows: list[list[str]],
    lines: list[int],
    is_head: Callable[[Sequence[str]], bool],
    above: Sequence[str] = (),
) -> Sheet:
    """Name the columns by the first row that does, else by the first row; a row of loops above it
    names them further.
    """
    start = next((i for i, row in enumerate(rows[:_PREAMBLE]) if is_head(row)), 0)
    names = [name.strip() for name in rows[start]] if rows else []
    while (
        len(names) > 1
        and not names[-1]
        and all(len(r) < len(names) or not r[len(names) - 1].strip() for r in rows[start:])
    ):
        names.pop()
    over = rows[start - 1] if start else above
    merged = _merged(names, [c.strip() for c in over])
    names = _distinct(merged)
    several_times = "" in names or names != merged
    again = rows.count(rows[start]) - 1 if rows else 0
    if again > 0:  # exports written one after the other
        lines = [line for i, line in enumerate(lines) if i <= start or rows[i] != rows[start]]
        rows = [row for i, row in enumerate(rows) if i <= start or row != rows[start]]
    body, kept = rows[start + 1 :], lines[start + 1 :]
    even = all(len(row) == len(names) for row in body)
    if not even:
        body, kept = [], []
    for row, line in () if even else zip(rows[start + 1 :], lines[start + 1 :], strict=True):
        while len(row) > len(names) and not row[-1].strip():
            row.pop()
        if len(row) < len(names) and several_times:
            # of a time column per tag, the shorter series have ended
            row += [""] * (len(names) - len(row))
        if len(row) != len(names):
            raise RecordError(
                f"{path}, line {line}: {len(row)} cells; the header has {len(names)}, as many are"
                " needed"
            )
        body.append(row)
        kept.append(line)
    names = [name or f"{BLANK}{i}" for i, name in enumerate(names)] if any(names) else names
    if not any(names):
        raise RecordError(
            f"file {path} has no header line; the names of its columns are needed first"
        )
    times = Counter(n.lower() for n in names)
    twice = next((n for n in names if n and times[n.lower()] > 1), None)
    if twice:
        raise RecordError(f"file {path}: column {twice!r} appears twice; one is needed")
    columns = dict(
        zip(
            names,
            (list(c) for c in zip(*body, strict=True)) if body else [[] for _ in names],
            strict=True,
        )
    )
    skipped = sum(any(c.strip() for c in row) for row in rows[:start])
    note = [f"file: {skipped} lines above the header left out"] * (skipped > 0)
    return Sheet(
        columns,
        kept,
        "",
        note + [f"file: {again} repetitions of the header left out"] * (again > 0),
    )


def _merged(names: list[str], over: list[str]) -> list[str]:
    """Put the names of a row above, each over several columns, before the names of the columns that
    it covers.
    """
    over = (over + [""] * len(names))[: len(names)]
    low = [n.lower() for n in names if n]
    covers = any(over[1:]) and (not over[0] or not names[0] or len(set(low)) < len(low))
    if not covers or len(set(filter(None, over))) >= max(len(names) - 1, 2) or not names:
        return names
    out, last = [], ""
    for name, above in zip(names, over, strict=True):
        last = above or last
        out.append(
            f"{last}.{name}"
            if name and last and not (last == over[0] and name == names[0])
            else name or above
        )
    return out


def _distinct(names: list[str]) -> list[str]:
    """Number the columns of time and of quality, of which a table may have one per signal."""
    seen: Counter[str] = Counter()
    out = []
    for name in names:
        word = re.sub(r"[^a-z]", "", name.lower())
        if word in _OFTEN:
            seen[word] += 1
            name = name if seen[word] == 1 else f"{name}.{seen[word] - 1}"
        out.append(name)
    return out

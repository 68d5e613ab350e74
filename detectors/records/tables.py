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
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.dialects import entries

BLANK = "\0"  # begins the name of a column that has none
MOST_ROWS = 1_000_000  # of a sheet
MOST_PARQUET_ROWS = 10_000_000  # a year of 3 s samples
MOST_PARQUET_BYTES = 1_000_000_000  # without compression
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"  # begins a compound file, as which Excel encrypts, too
MOST_UNPACKED = 300_000_000  # bytes of an Excel file's parts

Columns = dict[str, list | np.ndarray]
_DELIMITERS = ",;\t|"
_PREAMBLE = 60  # lines in which the header is looked for
_OFTEN = entries("""
    time, timestamp, datetime, date, value, quality, qualitycode, qc, status, confidence, validity
""")


@dataclass
class Sheet:
    """A table as its file holds it."""

    columns: Columns  # cells by name
    # of the file of each row; empty where a file has none
    lines: list[int] = field(default_factory=list)
    delimiter: str = ""  # between the cells of a CSV
    notes: list[str] = field(default_factory=list)  # what had to be done to read it
    unit: str = "line"  # what a row is called

    def place(self, row: int) -> str:
        """Return where a row stands, as its file counts."""
        return f"{self.unit} {self.lines[row] if self.lines else row + 2}"

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


def read_sheets(
    path: Path, is_head: Callable[[Sequence[str]], bool], counted: bool = False
) -> dict[str, Sheet]:
    """Read the tables of a file by name: of a workbook every sheet with a header, or the first;
    else the only one. Columns of a text without a header have the numbers 1, 2, ... where they are
    `counted`.
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
            starts = {n: [*map(is_head, rows[:_PREAMBLE])] for n, rows in sheets.items()}
            whose = [n for n, heads in starts.items() if any(heads)] or list(sheets)[:1]
            return {n: _of_workbook(path, sheets[n], starts[n]) for n in whose}
    except RecordError:
        raise
    except Exception as error:  # pandas passes on whatever its engine raises
        message = str(error).partition("\n")[0].partition(", you must")[0]  # advice to programmers
        raise RecordError(
            f"file {path} cannot be read as {suffix[1:]}: {message}; a whole file is needed"
        ) from error
    collecting = gc.isenabled()
    gc.disable()  # a million rows, none of them garbage, would be looked through again and again
    try:
        return {"": _csv(path, is_head, counted)}
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


def rises(cells: Sequence[object] | np.ndarray) -> bool:
    """Return whether a column rises from row to row, as time and counters do and no signal of a
    loop does.
    """
    try:
        numbers = np.array([float(str(cell).replace(",", ".")) for cell in cells])
    except ValueError:
        return False
    return numbers.size > 1 and bool(np.all(np.diff(numbers) > 0.0))


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


def _of_workbook(path: Path, rows: list[list[str]], heads: list[bool]) -> Sheet:
    """Return the table of a sheet, which begins at the first row that is a head."""
    start = heads.index(True) if any(heads) else 0
    above = rows[start - 1] if start else []
    sheet = _table(path, rows, list(range(1, len(rows) + 1)), start, above)
    sheet.notes[:0] = _left_out(sum(any(map(str.strip, row)) for row in rows[:start]))
    return sheet


def columns_of(table: Any) -> Columns:
    """Return the cells of a data frame, or of a mapping of names to arrays or lists."""
    if hasattr(table, "index") and hasattr(table, "dtypes"):
        return _from_frame(table)
    cells: Columns = {}
    for name, values in table.items():
        array = np.asarray(values)
        cells[str(name)] = array if array.dtype.kind in "fiuM" else array.tolist()
    sizes = {name: np.shape(c)[0] if np.ndim(c) == 1 else -1 for name, c in cells.items()}
    if len(set(sizes.values())) > 1 or -1 in sizes.values():
        told = ", ".join(f"{n} {'no column' if k < 0 else k}" for n, k in sizes.items())
        raise RecordError(f"columns of one length are needed, not {told}")
    return cells


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


def _decode(path: Path) -> tuple[str, list[str]]:
    """Return a file's text by the first encoding that all of it has, and the note on a guess."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"file {path} cannot be read: {error.strerror}") from error
    wide = _utf16(data[:4096])
    if not wide and b"\0" in data[:4096]:
        raise RecordError(
            f"file {path} is binary; a text table (CSV), .parquet, .xlsx or .mat is needed"
        )
    try:
        return data.decode(wide or "utf-8-sig"), []
    except UnicodeDecodeError as error:
        if wide:
            raise RecordError(
                f"file {path} is damaged UTF-16 text (byte {error.start}); whole ones are needed"
            ) from error
        guess = "Windows-1252; numbers are the same in both"
        text = data.decode("cp1252", errors="replace")
        return text, [f"file: byte {error.start} is not UTF-8, read as {guess}"]


def _utf16(head: bytes) -> str:
    """Return in which UTF-16 a text begins, "" in none: without a mark every other byte is 0."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    for code, half in (("utf-16-be", head[0::2]), ("utf-16-le", head[1::2])):
        if half.count(0) > 0.4 * len(half) and half.count(0) == head.count(0):
            return code
    return ""


def _csv(path: Path, is_head: Callable[[Sequence[str]], bool], counted: bool) -> Sheet:
    """Read text by the delimiter under which a line names the signals; pandas would guess it
    without a note, and fill up lines that are too short.
    """
    text, notes = _decode(path)
    lines = text.splitlines()
    first = lines[:_PREAMBLE]
    marks = [d for d in _DELIMITERS if any(d in line for line in first)]
    if not marks and any(is_head(line.split()) for line in first):  # columns apart by spaces
        lines = [" ".join(line.split()) for line in lines]
        marks = [" "]
    if not marks and first and _all_numbers(first[0].split()):
        lines = [" ".join(line.split()) for line in lines]
        marks = [" "]
    added = 0
    if counted and lines and marks:
        mark = max(marks, key=lines[0].count)
        cells = lines[0].split(mark)
        if _all_numbers(cells):
            lines = [mark.join(str(k + 1) for k in range(len(cells))), *lines]
            added = 1
            notes = [*notes, "file: no header line, columns are counted from 1"]
    start, delimiter = _begin(path, lines[:_PREAMBLE], marks, is_head)
    rows = []
    numbers = []
    for cells, line in _cells(path, lines[start:], delimiter):
        if cells and cells != [""]:
            rows.append(cells)
            numbers.append(start + line - added)
    above = _first_row(path, lines[max(start - 1, 0) : start], delimiter)
    sheet = _table(path, rows, numbers, 0, above)
    skipped = sum(bool(line.strip()) for line in lines[:start])
    sheet.notes = notes + _left_out(skipped) + sheet.notes
    sheet.delimiter = delimiter
    return sheet


def _begin(
    path: Path, lines: list[str], marks: list[str], is_head: Callable[[Sequence[str]], bool]
) -> tuple[int, str]:
    """Return the first line that is a head, else the first, and the delimiter of its cells."""
    for i, line in enumerate(lines):
        fit = [d for d in marks if is_head(_first_row(path, [line], d))]
        if fit:
            return i, max(fit, key=line.count)
    return 0, max((*_DELIMITERS, *marks), key="".join(lines[:1]).count)


def example_of_columns(columns: Mapping[str, Sequence[object] | np.ndarray]) -> str:
    """Return the option that says which column without a name is which: time and signals as they
    may be, "" where too few of them move.
    """
    clocks = [k for k, cells in columns.items() if rises(cells)]
    signals = [k for k, cells in columns.items() if k not in clocks and len({*cells}) > 1]
    if len(signals) < 2:
        return ""
    named = [*(f"t={k}" for k in clocks[:1]), f"pv={signals[0]}", f"op={signals[1]}"]
    return f"--columns {','.join(named)}"


def _all_numbers(cells: Sequence[str]) -> bool:
    """Whether two cells or more are all numbers: samples, and no names of columns."""
    try:
        return len([float(cell) for cell in cells]) > 1
    except ValueError:
        return False


def _left_out(lines: int) -> list[str]:
    return [f"file: {lines} lines above the header left out"] * (lines > 0)


def _first_row(path: Path, lines: list[str], delimiter: str) -> list[str]:
    return next(_cells(path, lines, delimiter), ([], 0))[0]


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
    path: Path, rows: list[list[str]], lines: list[int], start: int, above: Sequence[str] = ()
) -> Sheet:
    """Name the columns by the row `start`, alike ones by the row `above`, too; the rows below are
    the samples.
    """
    head = rows[start] if rows else []
    if not any(name.strip() for name in head):
        raise RecordError(
            f"file {path} has no header line; the names of its columns are needed first"
        )
    if _all_numbers(head) and head != [str(k + 1) for k in range(len(head))]:
        shown = ", ".join(cell.strip() for cell in head[:3])
        sentence = (
            f"file {path} has no header line, the first holds numbers ({shown}, ...); the names of"
            " its columns are needed first, or which column, counted from 1, is which"
        )
        whole = [row for row in rows[start:] if len(row) == len(head)]
        columns: Columns = {
            str(k): list(cells) for k, cells in enumerate(zip(*whole, strict=True), 1)
        }
        raise RecordError(sentence, example_of_columns(columns))
    names = _of_loops(_distinct([name.strip() for name in head]), above)
    body = rows[start + 1 :]
    lines = lines[start + 1 :]
    again = rows.count(head) - 1
    if again:  # exports one after the other
        lines = [line for row, line in zip(body, lines, strict=True) if row != head]
        body = [row for row in body if row != head]
    if any(len(row) != len(names) for row in body):
        # of a column of times per tag, the shorter series have ended
        shorter = "" in names or any(name.endswith(".1") for name in names)
        body = [_fit_row(row, len(names), shorter) for row in body]
    odd = next((i for i, row in enumerate(body) if len(row) != len(names)), None)
    if odd is not None:
        raise RecordError(
            f"{path}, line {lines[odd]}: {len(body[odd])} cells; the header has {len(names)}, as"
            " many are needed"
        )
    names = [name or f"{BLANK}{i}" for i, name in enumerate(names)]
    times = Counter(n.lower() for n in names)
    twice = next((n for n in names if times[n.lower()] > 1), None)
    if twice:
        raise RecordError(f"file {path}: column {twice!r} appears twice; one is needed")
    cells = zip(*body, strict=True) if body else ([] for _ in names)
    notes = [f"file: {again} repetitions of the header left out"] * (again > 0)
    columns: Columns = {name: list(column) for name, column in zip(names, cells, strict=True)}
    return Sheet(columns, lines, "", notes)


def _fit_row(row: list[str], size: int, shorter: bool) -> list[str]:
    """Return a row without empty cells beyond its columns, and with those that have ended."""
    extra = row[size:] if not "".join(row[size:]).strip() else []
    row = row[: len(row) - len(extra)]
    return row + [""] * (size - len(row)) if shorter else row


def _of_loops(names: list[str], above: Sequence[str]) -> list[str]:
    """Put the loop in a merged cell above before the names that several columns have."""
    out = []
    loop = ""
    for name, over in zip_longest(names, above[: len(names)], fillvalue=""):
        loop = over.strip() or loop
        out.append(f"{loop}.{name}" if name and loop and names.count(name) > 1 else name)
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

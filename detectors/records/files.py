"""Read a file as tables of cells: text with any separator, parquet, the sheets of a workbook."""

from __future__ import annotations

import codecs
import csv
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError

Cells = list | np.ndarray
Row = tuple[list[str], int]  # cells, and where they stand in the file
IsHead = Callable[[Sequence[str]], bool]

MOST_UNPACKED = 1_000_000_000  # bytes that a packed file takes once it is read
_PREAMBLE = 60  # lines in which the header is looked for
_UNIT_ROWS = 3  # below the header
_CHUNK = 200_000  # cells that are read before they are packed
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"  # begins a compound file, as which Excel encrypts, too


@dataclass
class Sheet:
    """A table as its file holds it: cells by column, and where each row stands in the file."""

    where: str
    columns: dict[str, Cells]
    lines: Sequence[int] = ()
    row: str = "line"  # what a row is called
    delimiter: str = ""
    units: dict[str, str] = field(default_factory=dict)  # of columns, from rows below the header
    notes: list[str] = field(default_factory=list)  # what had to be done to read it
    about: dict[str, Any] = field(default_factory=dict)  # what the file states of its loop
    # what its columns are, found once for all loops
    found: dict[str, list[str]] = field(default_factory=dict)

    def place(self, row: int) -> str:
        """Return where a row stands, as its file counts."""
        return f"{self.row} {self.lines[row] if len(self.lines) else row + 2}"


def read_tables(path: Path, is_head: IsHead) -> dict[str, Sheet]:
    """Return the tables of a file: of a workbook the sheets with a header by name, else one."""
    # a file with something in it
    if not path.is_file() or path.stat().st_size == 0:
        if path.is_file():
            why = "is empty"
        elif path.exists():
            why = "is no file"
        else:
            why = "does not exist"
        raise RecordError(f"file {path} {why}; a header line and one line per sample are needed")

    # by its ending
    kind = path.suffix.lower()
    try:
        if kind in (".parquet", ".pq"):
            return {"": _read_parquet(path)}
        if kind in (".xlsx", ".xls"):
            return _read_workbook(path, is_head)
        return {"": _read_text(path, is_head)}
    except RecordError:
        raise
    except Exception as error:  # each library raises its own
        why = str(error).partition("\n")[0]
        needed = "a whole file is needed"
        raise RecordError(f"file {path} cannot be read as {kind[1:]}: {why}; {needed}") from error


def read_texts(path: str | Path) -> Sheet:
    """Return the texts of a CSV whose first line names its columns."""
    import pandas as pd

    try:
        with open(path, encoding="utf-8-sig") as file:
            first = file.readline()
        mark = max(",;\t", key=first.count)
        frame = pd.read_csv(path, sep=mark, dtype=str, keep_default_na=False, encoding="utf-8-sig")
        return table_of(frame, str(path), "line")
    except Exception as error:  # the file's, or one of many of its reader
        why = str(error).partition("\n")[0]
        broken = f"file {path} cannot be read as a table: {why}"
        raise RecordError(f"{broken}; rows as long as the header are needed") from error


def table_of(columns: Any, where: str, row: str = "row") -> Sheet:
    """Return the table of a data frame, or of a mapping of names to arrays or lists."""
    # times may stand in the index of a frame; a text that repeats is kept once
    if hasattr(columns, "reset_index"):
        named = columns.index.name or columns.index.dtype.kind == "M"
        if named:
            frame = columns.reset_index()
        else:
            frame = columns
        frame = frame.astype({n: object for n in frame if frame[n].dtype.kind not in "fiuM"})
        columns = {}
        for name in frame:
            columns[name] = frame[name].to_numpy()

    # numbers and times as arrays, everything else as it is
    cells: dict[str, Cells] = {}
    for name, values in columns.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiuM":
            cells[str(name)] = array
        else:
            cells[str(name)] = array.tolist()
        if array.ndim != 1 or array.size != len(next(iter(cells.values()))):
            wrong = f"column {name} has shape {array.shape}"
            raise RecordError(f"{where}: {wrong}; columns of one length are needed")

    # The rows that can be named in an error
    size = len(next(iter(cells.values()), ()))
    return Sheet(where, cells, range(size) if row == "row" else (), row)


def _read_parquet(path: Path) -> Sheet:
    """Read a parquet file; a large one is refused by its footer alone."""
    from pyarrow.parquet import ParquetFile, read_table

    file = ParquetFile(path)
    columns = [file.schema.column(k) for k in range(file.metadata.num_columns)]
    _refuse_large(path, 8 * file.metadata.num_rows * len(columns))
    texts = [column.path for column in columns if column.physical_type == "BYTE_ARRAY"]
    return table_of(read_table(path, read_dictionary=texts).to_pandas(), str(path), "line")


def _read_workbook(path: Path, is_head: IsHead) -> dict[str, Sheet]:
    """Read the sheets that have a header, or the first, from their header on."""
    import zipfile

    import pandas as pd

    # what no sheet can be read of, or too large a one
    with open(path, "rb") as file:
        if file.read(4) == _OLD_EXCEL:
            old = f"file {path} is a workbook of an old Excel, or one with a password"
            raise RecordError(f"{old}; one saved as .xlsx without a password is needed")
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as packed:
            _refuse_large(path, 3 * sum(part.file_size for part in packed.infolist()))

    # the sheets with a header, from it on, as texts
    sheets: dict[str, list[Row]] = {}
    tables = {}
    for name, frame in pd.read_excel(path, header=None, dtype=object, sheet_name=None).items():
        cells = frame.fillna("").astype(str).itertuples(index=False, name=None)
        sheets[name] = rows = [(list(row), line) for line, row in enumerate(cells, 1)]
        start = next((k for k, (row, _) in enumerate(rows[:_PREAMBLE]) if is_head(row)), None)
        if start is not None:
            above = sum(any(row) for row, _ in rows[:start])
            tables[name] = _build_table(str(path), iter(rows[start:]), above)
    if len(tables) > 1:
        return tables
    first = next(iter(sheets.values()))
    return {"": next(iter(tables.values()), None) or _build_table(str(path), iter(first), 0)}


def _refuse_large(path: Path, size: int) -> None:
    if size > MOST_UNPACKED:
        most = f"at most {MOST_UNPACKED / 1e6:.0f} MB are read"
        raise RecordError(f"file {path} unpacks to {size / 1e6:.0f} MB; {most}")


def _read_text(path: Path, is_head: IsHead) -> Sheet:
    """Read text by the separator under which a line names the signals."""
    # the encoding, which all of the file must have
    data = path.read_bytes()
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    if b"\0" in data[:4096] and not wide:
        needed = "a text table (CSV), .parquet, .xlsx or .mat is needed"
        raise RecordError(f"file {path} is binary; {needed}")
    encoding = "utf-16" if wide else "utf-8-sig"
    notes = []
    try:
        data.decode(encoding)
    except UnicodeDecodeError as error:
        encoding = "cp1252"
        guess = "Windows-1252; numbers are the same in both"
        notes = [f"file: byte {error.start} is not UTF-8, read as {guess}"]
    del data

    # the table from its header on, empty lines left out
    with open(path, encoding=encoding, errors="replace", newline="") as file:
        delimiter, start = _find_head(list(islice(file, _PREAMBLE)), is_head)
        file.seek(0)
        above = sum(bool(line.strip()) for line in islice(file, start))
        reader = csv.reader(file, delimiter=delimiter, skipinitialspace=True)
        rows = ((row, start + reader.line_num) for row in reader if row and row != [""])
        try:
            table = _build_table(str(path), rows, above)
        except csv.Error as error:
            line = start + reader.line_num
            raise RecordError(f"{path}, line {line}: {error}; shorter cells are needed") from error

    # What was found out about the file stands first
    table.delimiter = delimiter
    table.notes[:0] = notes
    return table


def _find_head(lines: list[str], is_head: IsHead) -> tuple[str, int]:
    """Return the separator and the place of the line that names signals, else of the first."""
    marks = ",;\t| "
    for k, line in enumerate(lines):
        for mark in marks:
            cells = [cell.strip(' "\r\n') for cell in line.split(mark)]
            if is_head([cell for cell in cells if cell]):
                return mark, k
    return max(marks[:4], key="".join(lines[:1]).count) if lines else " ", 0


def _build_table(where: str, rows: Iterator[Row], above: int) -> Sheet:
    """Name the columns by the first row, take the rows of units below it, and pack the others."""
    # names, or the numbers of the columns
    notes = [f"file: {above} lines above the header left out"] * (above > 0)
    head, line = next(rows, ([], 0))
    while head and not head[-1].strip():
        head.pop()
    if not head:
        raise RecordError(f"file {where} has no header line; the names of its columns are needed")
    first = head
    if len(head) > 1 and all(map(_is_number, head[1:])):
        notes.append("file: no header line, columns are counted from 1")
        rows = chain([(head, line)], rows)
        first = [str(k) for k in range(1, len(head) + 1)]
        head = []
    names: dict[str, int] = {}
    for k, cell in enumerate(first, 1):
        name = cell.strip() or f"column {k}"
        names[f"{name} ({k})" if name in names else name] = k

    # rows without a number before the first with one
    units: dict[str, str] = {}
    for row, line in islice(rows, _UNIT_ROWS):
        if any(cell.lstrip("+-. ")[:1].isdigit() for cell in row) or not any(row):
            rows = chain([(row, line)], rows)
            break
        units |= {n: c.strip("[]() ").lower() for n, c in zip(names, row) if c.strip()}
        said = ", ".join(filter(None, row))
        notes.append(f"file: line {line} taken as units or descriptions: {said}")

    # the samples, in arrays where they are numbers
    lines = array("q")
    parts: list[list[Cells]] = [[] for _ in names]
    samples = _check_rows(where, rows, len(names), head, lines)
    while chunk := list(islice(samples, 1 + _CHUNK // len(names))):
        for part, cells in zip(parts, zip(*chunk, strict=True), strict=True):
            part.append(_pack_cells(cells))
    columns = {name: _join_cells(part) for name, part in zip(names, parts, strict=True)}
    return Sheet(where, columns, lines, units=units, notes=notes)


def _check_rows(
    where: str, rows: Iterator[Row], size: int, head: list[str], lines: array
) -> Iterator[list[str]]:
    """Yield the cells of rows, and add the lines on which they stand; a header may be repeated."""
    for row, line in rows:
        if row == head:  # exports one after the other
            continue
        if len(row) != size and (len(row) < size or any(map(str.strip, row[size:]))):
            needed = f"the header has {size}, as many are needed"
            raise RecordError(f"{where}, line {line}: {len(row)} cells; {needed}")
        lines.append(line)
        yield row[:size]


def _pack_cells(cells: Sequence[str]) -> Cells:
    """Return cells as an array where all are numbers, or empty."""
    try:
        x = np.array([cell or "nan" for cell in cells], dtype=np.float64)
    except ValueError:
        return list(cells)
    # Python reads 1_000 as a number, and 1e999 as infinite
    if np.isinf(x).any() or "_" in "".join(cells):
        return list(cells)
    return x


def _join_cells(parts: list[Cells]) -> Cells:
    if parts and all(isinstance(part, np.ndarray) for part in parts):
        return np.concatenate(parts)
    cells = []
    for part in parts:
        for cell in part if isinstance(part, list) else part.tolist():
            cells.append(cell)
    return cells


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True

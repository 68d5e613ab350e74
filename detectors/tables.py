"""Tables: a CSV, parquet or Excel file becomes named columns, and a column becomes numbers or seconds."""

from __future__ import annotations

import csv
import zipfile
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path

import numpy as np

from detectors.errors import RecordError

TIME_FORMATS = ("%d.%m.%Y %H:%M:%S", "%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S", "%Y/%m/%d %H:%M:%S", "%d-%b-%Y %H:%M:%S")

MOST_ROWS = 1_000_000  # of a sheet
MOST_UNPACKED = 300_000_000  # bytes of an Excel file's parts

Columns = dict[str, list | np.ndarray]
NEEDED = "a number, or nothing for unknown, is needed"


def read_table(path: Path) -> Columns:
    """Read a table, its cells as they stand.

    Parameters
    ----------
    path : Path
        CSV (comma, semicolon or tab; UTF-8), .parquet or .xlsx.

    Returns
    -------
    dict of str to list or ndarray
        Cells by column name; text of a CSV is not converted yet.

    Raises
    ------
    RecordError
        When the file is missing, empty, binary, wrongly encoded, ragged or damaged.
    """
    if not path.exists():
        raise RecordError(f"file {path} does not exist")
    if not path.is_file():
        raise RecordError(f"{path} is no file")
    if path.stat().st_size == 0:
        raise RecordError(f"file {path} is empty")
    suffix = path.suffix.lower()
    try:
        if suffix in (".parquet", ".pq"):
            import pandas as pd

            return _from_frame(pd.read_parquet(path))
        if suffix in (".xlsx", ".xls"):
            return _from_frame(_sheet(path))
    except RecordError:
        raise
    except Exception as error:  # pandas passes on whatever its engine raises
        raise RecordError(f"file {path} cannot be read as {suffix[1:]}: {str(error).splitlines()[0]}") from error
    return _csv(path)


def _sheet(path: Path):
    """Read the first sheet; a small file that unpacks to a large one is refused before it fills the memory."""
    import pandas as pd

    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as packed:
            size = sum(item.file_size for item in packed.infolist())
        if size > MOST_UNPACKED:
            raise RecordError(f"file {path} unpacks to {size / 1e6:.0f} MB; at most {MOST_UNPACKED / 1e6:.0f} MB are read")
    frame = pd.read_excel(path, nrows=MOST_ROWS + 1)
    if len(frame) > MOST_ROWS:
        raise RecordError(f"file {path} has more than {MOST_ROWS} rows; a sheet of Excel cannot hold many more")
    return frame


def _from_frame(frame) -> Columns:
    return {str(c): frame[c].to_numpy() if frame[c].dtype.kind in "fiuM" else _texts(frame[c]) for c in frame.columns}


def _texts(column) -> list:
    return [None if missing else v for v, missing in zip(column, column.isna(), strict=True)]


def _csv(path: Path) -> Columns:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"file {path} cannot be read: {error.strerror}") from error
    if b"\0" in data[:4096] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordError(f"file {path} is binary; a text table (CSV), .parquet, .xlsx or .mat is needed")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordError(f"file {path} is not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    lines = text.splitlines()
    head = lines[0] if lines else ""
    rows = csv.reader(lines, delimiter=max(",;\t", key=head.count))
    try:
        names = [name.strip() for name in next(rows, [])]
        body = []
        for row in rows:
            if not row or row == [""]:
                continue
            while len(row) > len(names) and not row[-1].strip():
                row.pop()
            if len(row) != len(names):
                raise RecordError(f"{path}, line {rows.line_num}: {len(row)} cells; the header has {len(names)}")
            body.append(row)
    except csv.Error as error:
        raise RecordError(f"{path}, line {rows.line_num}: {error}") from error
    if not any(names):
        raise RecordError(f"file {path} has no header line")
    twice = next((n for n in names if n and [m.lower() for m in names].count(n.lower()) > 1), None)
    if twice:
        raise RecordError(f"file {path}: column {twice!r} appears twice")
    return dict(zip(names, (list(c) for c in zip(*body, strict=True)) if body else [[] for _ in names], strict=True))


def numbers(values: list | np.ndarray, name: str, where: str) -> np.ndarray:
    """Return a column as float64, NaN where it is empty.

    Parameters
    ----------
    values : list or ndarray
        Cells.
    name, where : str
        Column and file, for messages.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    RecordError
        With the line, for text that is no number, and for infinity.

    Examples
    --------
    >>> numbers(["1.5", "", "2,5"], "pv", "FIC101.csv")
    array([1.5, nan, 2.5])
    """
    if isinstance(values, np.ndarray) and values.dtype.kind in "fiub":
        array = values.astype(np.float64)
    else:
        texts = ["" if v is None else str(v).strip() for v in values]
        try:
            array = np.array([float(v) if v else np.nan for v in texts])
        except ValueError:
            array = np.array([_number(v, i, name, where) if v else np.nan for i, v in enumerate(texts)])
    infinite = np.flatnonzero(np.isinf(array))
    if infinite.size:
        raise RecordError(f"{where}, line {infinite[0] + 2}: {name} is infinite; {NEEDED}")
    return array


def _number(text: str, row: int, name: str, where: str) -> float:
    try:
        return float(text.replace(",", "."))  # decimal comma of semicolon files
    except ValueError:
        raise RecordError(f"{where}, line {row + 2}: {name} is {text!r}; {NEEDED}") from None


def seconds(values: list | np.ndarray, name: str, where: str) -> np.ndarray:
    """Return a time column in seconds, from numbers or timestamps.

    Parameters
    ----------
    values : list or ndarray
        Cells: numbers (s), ISO timestamps, or one of `TIME_FORMATS`.
    name, where : str
        Column and file, for messages.

    Returns
    -------
    ndarray, shape (n,)
        Strictly rising.

    Raises
    ------
    RecordError
        With the line, for a missing or unreadable time and for time that does not rise.

    Examples
    --------
    >>> t = seconds(["2024-05-31 14:05:00", "2024-05-31 14:05:10"], "time", "FIC101.csv")
    >>> float(t[1] - t[0])
    10.0
    """
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        t = values.astype("datetime64[ns]").astype(np.int64) * 1e-9
        t[np.isnat(values)] = np.nan
    elif isinstance(values, np.ndarray) and values.dtype.kind in "fiu":
        t = values.astype(np.float64)
    else:
        t = _read_times([str(v).strip() for v in values], name, where)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise RecordError(f"{where}, line {bad[0] + 2}: {name} is unknown; every sample needs its time")
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        was, now = values[back[0]], values[back[0] + 1]
        raise RecordError(f"{where}, line {back[0] + 3}: {name} does not rise ({was}, then {now})")
    return t


def _read_times(texts: list[str], name: str, where: str) -> np.ndarray:
    # The whole column decides between numbers, day first and month first: the reading that gets furthest.
    furthest = 0
    for form in ("number", "iso", *TIME_FORMATS, *(f.replace(":%S", "") for f in TIME_FORMATS)):
        t = list(takewhile(lambda x: x is not None, (_time(text, form) for text in texts)))
        if len(t) == len(texts):
            return np.array(t, dtype=float)
        furthest = max(furthest, len(t))
    needed = "seconds, or a timestamp like 2024-05-31 14:05:00, is needed"
    raise RecordError(f"{where}, line {furthest + 2}: {name} is {texts[furthest]!r}; {needed}")


def _time(text: str, form: str) -> float | None:
    try:
        if form == "number":
            return float(text.replace(",", "."))
        stamp = datetime.fromisoformat(text) if form == "iso" else datetime.strptime(text, form)
    except ValueError:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()

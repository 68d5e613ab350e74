"""Columns of numbers that a loop file names and a CSV file beside it holds: residuals that are
drawn again, what an archive did to the samples, and a set point that moves often.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

from simbench.scenarios.errors import SpecError

RESIDUALS = ("op", "input", "output")  # the places where residuals enter a loop
_HELD = ("op_held", "pv_held")  # 1 where an archive repeats its last value
_MOVES = ("sp_time", "sp")  # steps of the set point: when (s), and to where
_MOST_IN_A_LINE = 40  # of these, in the loop file itself


def with_columns(table: Mapping[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """Return a loop's table with the numbers of the files that it names in their place."""
    whole = dict(table)
    loads = whole.get("disturbance")
    if isinstance(loads, (list, tuple)):
        whole["disturbance"] = [_fill_columns(part, RESIDUALS, folder, where) for part in loads]
    if "archive" in whole:
        whole["archive"] = _fill_columns(whole["archive"], _HELD, folder, where)
    if "setpoint" in whole:
        whole["setpoint"] = _fill_steps(whole["setpoint"], folder, where)
    return whole


def _fill_steps(setpoint: Any, folder: Path, where: str) -> Any:
    """Return a set point with the steps that its file has as two columns."""
    filled = _fill_columns(setpoint, _MOVES, folder, where)
    if filled is setpoint:
        return setpoint
    at, to = (filled.pop(name, []) for name in _MOVES)
    if len(at) != len(to):
        raise SpecError(
            f"{where}: setpoint: {len(at)} numbers of sp_time and {len(to)} of sp; as many of both"
            " are needed"
        )
    return {**filled, "steps": list(zip(at, to))}


def _fill_columns(part: Any, names: tuple[str, ...], folder: Path, where: str) -> Any:
    """Return one section with the columns that its file has of these names."""
    if not isinstance(part, Mapping) or "file" not in part:
        return part

    # a file beside the loop file: of others, a loop file of a stranger could print a part
    file = part["file"]
    if not isinstance(file, str) or not file:
        raise SpecError(f"{where}: file = {file!r}; the name of a CSV file is needed")
    if not _is_inside(folder, file):
        raise SpecError(
            f"{where}: file = {file!r} is not in the folder of the loop file; one there, or in a"
            " folder below, is needed"
        )

    # its columns, in place of none
    beside = [name for name in names if name in part]
    if beside:
        raise SpecError(f"{where}: file and {beside[0]} are given; one of both is needed")
    columns = read_columns(folder / file)
    found = {}
    for name in names:
        if name in columns:
            found[name] = columns[name]
    if not found:
        raise SpecError(
            f"{where}: {file} has the columns {', '.join(columns)}; at least one of"
            f" {', '.join(names)} is needed"
        )
    return {key: value for key, value in part.items() if key != "file"} | found


def _is_inside(folder: Path, file: str) -> bool:
    """Return whether a file stands in a folder or below, wherever its links lead."""
    try:
        return (folder / file).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a link to itself, or a name that no file has
        return False


def read_columns(path: Path) -> dict[str, list[float]]:
    """Return the columns of a CSV file of numbers by their names."""
    # a pipe would be waited for
    if path.exists() and not path.is_file():
        raise SpecError(f"{path} is no file; a CSV file of numbers is needed")
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            rows = [row for row in csv.reader(lines) if row]
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error):
        raise SpecError(f"{path} cannot be read; a CSV file of numbers is needed") from None
    if len(rows) < 2:
        raise SpecError(f"{path} holds no numbers; a line of names and lines below it are needed")
    head = [name.strip().lower() for name in rows[0]]
    return {name: _read_column(path, rows, k) for k, name in enumerate(head)}


def _read_column(path: Path, rows: list[list[str]], k: int) -> list[float]:
    """Return one column, which may end before the others do."""
    cells = [row[k].strip() if k < len(row) else "" for row in rows[1:]]
    while cells and not cells[-1]:
        cells.pop()
    for line, cell in enumerate(cells, 2):
        try:
            finite = math.isfinite(float(cell))
        except ValueError:
            finite = False
        if not finite:
            raise SpecError(f"{path}: line {line}: column {k + 1} is {cell!r}; a number is needed")
    return [float(cell) for cell in cells]


def in_a_file(table: Mapping[str, Any], file: str) -> tuple[dict[str, Any], str]:
    """Return a loop's table that names a file in place of the columns of its archive, of its first
    load that has some, and of a set point that moves often, and the text of that file; "" where
    there are none.
    """
    # every column with its name, and the file's name in its place
    loads = [dict(part) for part in table.get("disturbance", [])]
    load = next((part for part in loads if any(name in part for name in RESIDUALS)), {})
    archive = dict(table.get("archive") or {})
    columns: dict[str, Any] = {}
    setpoint = dict(table.get("setpoint") or {})
    if len(setpoint.get("steps", ())) > _MOST_IN_A_LINE:
        setpoint |= dict(zip(_MOVES, zip(*setpoint.pop("steps"))))
    for part, names in ((load, RESIDUALS), (archive, _HELD), (setpoint, _MOVES)):
        found = {}
        for name in names:
            if part.get(name):
                found[name] = part.pop(name)
        columns |= found
        if found:
            part |= {"file": file}
    if not columns:
        return dict(table), ""

    # the text, and the table in its order
    rows = zip_longest(*columns.values(), fillvalue="")
    text = [",".join(columns)] + [",".join(map(str, row)) for row in rows]
    moved = {"disturbance": loads, "archive": archive, "setpoint": setpoint}
    moved = {name: part for name, part in moved.items() if name in table and part}
    return {**table, **moved}, "\n".join(text) + "\n"

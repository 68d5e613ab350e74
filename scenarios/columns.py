"""Columns of numbers that a loop file names and a CSV file beside it holds: residuals that are
drawn again, and what an archive did to the samples.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simbench.scenarios.errors import SpecError

RESIDUALS = ("op", "input", "output")  # the places where residuals enter a loop
_HELD = ("op_held", "pv_held")  # 1 where an archive repeats its last value


def with_columns(table: Mapping[str, Any], folder: Path, where: str) -> dict[str, Any]:
    """Return a loop's table with the numbers of the files that it names in their place."""
    whole = dict(table)
    loads = whole.get("disturbance")
    if isinstance(loads, (list, tuple)):
        whole["disturbance"] = [_filled(part, RESIDUALS, folder, where) for part in loads]
    if "archive" in whole:
        whole["archive"] = _filled(whole["archive"], _HELD, folder, where)
    return whole


def _filled(part: Any, names: tuple[str, ...], folder: Path, where: str) -> Any:
    """Return one section with the columns that its file has of these names."""
    if not isinstance(part, Mapping) or "file" not in part:
        return part
    file = part["file"]
    if not isinstance(file, str) or not file:
        raise SpecError(f"{where}: file = {file!r}; the name of a CSV file is needed")
    columns = read_columns(folder / file)
    found = {name: columns[name] for name in names if name in columns}
    if not found:
        raise SpecError(
            f"{where}: {file} has the columns {', '.join(columns)}; at least one of"
            f" {', '.join(names)} is needed"
        )
    return {key: value for key, value in part.items() if key != "file"} | found


def read_columns(path: Path) -> dict[str, list[float]]:
    """Return the columns of a CSV file of numbers by their names."""
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
    return {name: [_number(path, i, row, k) for i, row in enumerate(rows[1:], 2)]
            for k, name in enumerate(head)}  # fmt: skip


def _number(path: Path, line: int, row: list[str], k: int) -> float:
    try:
        value = float(row[k])
    except (IndexError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        said = repr(row[k]) if k < len(row) else "missing"
        raise SpecError(f"{path}: line {line}: column {k + 1} is {said}; a number is needed")
    return value

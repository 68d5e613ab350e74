"""Read a TOML file that states what is known of each loop, with one `[[loop]]` table per tag
(option `--loops`).
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from simbench.detectors.errors import RecordError, nearest

_KEYS = {
    "tag": str,
    "file": str,
    "columns": dict,
    "op_span": list,
    "resample": str,
    "pv_span": list,
    "kind": str,
    "process": str,
    "Ts": float,
    "label": str,
    "loop": str,
    "unit_group": str,
}


def read_loop_table(path: str | Path) -> list[dict[str, Any]]:
    """Return the loops of a table, one dict each, checked."""
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordError(
            f"table of loops {path} cannot be read: {(error.strerror or str(error)).lower()}"
        ) from None
    except ValueError as error:
        raise RecordError(
            f"table of loops {path} is no TOML: {error}; [[loop]] tables are needed"
        ) from None
    rows = table.get("loop")
    if not isinstance(rows, list) or not rows or set(table) != {"loop"}:
        has = ", ".join(table) or "nothing"
        raise RecordError(
            f"table of loops {path}: it has {has}; [[loop]] tables, one a tag, are needed"
        )
    return [_check_row(row, f"table of loops {path}, loop {i}") for i, row in enumerate(rows, 1)]


def _check_row(row: dict[str, Any], where: str) -> dict[str, Any]:
    for key, value in row.items():
        if key not in _KEYS:
            raise RecordError(f"{where}: unknown key {key!r}, {nearest(key, _KEYS)}")
        needed = (int, float) if _KEYS[key] is float else _KEYS[key]
        if not isinstance(value, needed) or isinstance(value, bool):
            raise RecordError(
                f"{where}: {key} = {str(value)[:60]!r}; a {_KEYS[key].__name__} is needed"
            )
        if key.endswith("_span") and not (
            len(value) == 2 and all(isinstance(v, (int, float)) for v in value)
        ):
            raise RecordError(
                f"{where}: {key} = {value}; two numbers, what means 0 and 100 %, are needed"
            )
    if "tag" not in row:
        raise RecordError(f"{where} has no tag, which is needed")
    return {k: tuple(float(v) for v in v) if k.endswith("_span") else v for k, v in row.items()}

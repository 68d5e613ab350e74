"""Turn data frames into HTML tables that the reader can sort."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import pandas as pd

_Format = Callable[[Any], str]


def sortable(
    frame: pd.DataFrame,
    formats: Mapping[str, _Format] | None = None,
    long: Collection[str] = (),
    beside: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Any]:
    """Return columns and rows of a table as part.html draws them."""
    formats = formats or {}
    numbers = {
        c
        for c in frame.columns
        if pd.api.types.is_numeric_dtype(frame[c]) and frame[c].dtype != bool
    }
    # it stays in view when the rest is scrolled
    names = [c for c in frame.columns if c not in numbers and c not in long][:1]
    kinds = {
        c: "n" if c in numbers else "long" if c in long else "name" if c in names else ""
        for c in frame.columns
    }
    columns = [{"name": str(c), "kind": kind.replace("long", "")} for c, kind in kinds.items()]
    rows = []
    for i, record in enumerate(frame.itertuples(index=False, name=None)):
        row = []
        for name, value in zip(frame.columns, record):
            small = beside[name][i] if beside and name in beside else ""
            text = _text(value, formats.get(name))
            row.append(
                {
                    "text": text,
                    "small": small,
                    "kind": kinds[name],
                    "value": _key(value, name in numbers),
                }
            )
        rows.append(row)
    return {"columns": columns, "rows": rows}


def percent(value: float) -> str:
    """Write a share in %, one decimal."""
    return f"{100 * value:.1f} %"


def _text(value: Any, how: _Format | None) -> str:
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return ""
    if how is not None:
        return how(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _key(value: Any, number: bool) -> str | None:
    if not number:
        return None
    return "" if value is None or pd.isna(value) else repr(float(value))

"""Write records and baselines."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from simbench.files import whole_file
from simbench.scenarios.spec import Loop


def write_whole(file: Path, content: str | bytes) -> None:
    """Write whole or not at all: a call that is cut off can be resumed."""
    with whole_file(file, "w" if isinstance(content, str) else "wb") as f:
        f.write(content)


def write_item(item: Any, folder: Path, name: str) -> tuple[Path, Path]:
    """Write what an independent simulator drew: the record as name.csv and its baseline as
    name.toml; return both files.
    """
    record, baseline = folder / f"{name}.csv", folder / f"{name}.toml"
    write_whole(record, csv_of(item.columns))
    write_whole(baseline, Loop.from_table(item.baseline, name).to_toml())
    return record, baseline


def csv_of(columns: Mapping[str, np.ndarray]) -> str:
    """Return a record as the text of its CSV: the mode in words, no number where no sample was
    taken.
    """
    rows = zip(*([_cell(name, x) for x in c.tolist()] for name, c in columns.items()), strict=True)
    return "\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n"


def _cell(name: str, x: float) -> str:
    if name == "mode":
        return "MAN" if x else "AUTO"
    return f"{x:.8g}" if np.isfinite(x) else ""

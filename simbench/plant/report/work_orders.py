"""Write the work orders of a plant's loops as a CSV or Excel table."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd

from simbench.files import FileError, plain_cell, refuse_kind, whole_file, write_table
from simbench.plant.report.advice import NOBODY, best
from simbench.plant.report.fleet import Fleet


def orders(fleet: Fleet) -> pd.DataFrame:
    """Return one row per loop that somebody must see to, the most urgent first."""
    rows = []
    for m in fleet.members:
        if m.advice.job == NOBODY:
            continue
        first = best(m.actions)
        rows.append(
            {
                "priority": round(m.priority, 3),
                "loop": m.name,
                "who": m.advice.job,
                "cause": m.cause.name,
                "confidence": round(m.cause.confidence, 2),
                "status": m.status,
                "what to do": m.advice.do,
                "speaks for": "; ".join(m.cause.speaks_for),
                "speaks against": "; ".join(m.cause.against),
                "cost": m.cost.sentence(),
                "best action": "" if first is None else first.sentence(),
                "assumed": "; ".join(m.trust.record.notes),
            }
        )
    return pd.DataFrame(rows)


def refuse_orders(path: str | Path | None) -> None:
    """Refuse, before any work, a table of a kind that is not written."""
    if path is not None and Path(path).suffix.lower() != ".xlsx":
        refuse_kind(path)


def write_orders(fleet: Fleet, path: str | Path) -> None:
    """Write the table of work orders, as Excel where its name ends in .xlsx."""
    frame = orders(fleet)
    if Path(path).suffix.lower() != ".xlsx":
        write_table(frame, path)
        return
    content = io.BytesIO()
    try:
        frame.map(plain_cell).to_excel(content, index=False)
    except ImportError as error:
        raise FileError(
            f"{path}: Excel files need openpyxl ({error}); a name that ends in .csv works without"
        ) from None
    with whole_file(path, "wb") as f:
        f.write(content.getvalue())

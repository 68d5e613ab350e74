"""History: how accuracy moved from one baseline to the next."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from simbench.bench.store.manifest import RunError
from simbench.detectors.errors import UserError
from simbench.files import write_table

_HISTORY_FILE = "history.csv"
_SCORES = ("accuracy_applicable", "found", "false_alarms")
_HISTORY_COLUMNS = (
    "baseline",
    "commit",
    "records",
    "grid",
    "scenarios",
    "method",
    "rank",
    *_SCORES,
)


@dataclass(frozen=True, eq=False)
class History:
    """The baselines that were kept."""

    # one row per baseline (numbered from 1) and method: the commit and the hash of the records it
    # was made with, scenarios, rank and the rates against `cycled` with the oscillation front end,
    # where the method applies
    table: pd.DataFrame

    def as_text(self) -> str:
        """Return accuracy by method (rows) and baseline (columns), and what each baseline was made
        of.
        """
        wide = self.table.pivot(index="method", columns="baseline", values="accuracy_applicable")
        made = self.table.drop_duplicates("baseline")[["baseline", "commit", "grid", "scenarios"]]
        order = wide.iloc[:, -1].sort_values(ascending=False, kind="stable").index
        text = wide.loc[order].to_string(float_format="%.3f", na_rep="-")
        return (
            "Accuracy (share of right answers; label 'cycled') on the loops where the method"
            " applies:"
            f"\n{text}\n\n{made.to_string(index=False)}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the rows as JSON types."""
        return {"baselines": json.loads(self.table.to_json(orient="records", double_precision=6))}


def read_history(baseline: str | Path) -> History:
    """Read the history that stands in a baseline's folder."""
    file = Path(baseline) / _HISTORY_FILE
    if not file.is_file():
        raise RunError(
            f"{baseline} holds no {_HISTORY_FILE}: it is no baseline, or `simbench check --update`"
            " never wrote one there"
        )
    try:
        table = pd.read_csv(file)
    except (ValueError, UserError) as error:
        raise RunError(f"{file} is no table: {error}") from None
    missing = [c for c in _HISTORY_COLUMNS if c not in table]
    if missing or table.empty:
        raise RunError(
            f"{file} is no history: {f'it lacks {missing[0]}' if missing else 'it is empty'}"
        )
    return History(table)


def remember(baseline: Path, manifest: dict[str, Any], table: pd.DataFrame) -> None:
    """Add a baseline's scores to its history; the same records and the same scores are not written
    twice.
    """
    everything = (table["process"] == "all") & (table["population"] == "all")
    rows = table[(table["truth"] == "cycled") & table["front_end"] & everything]
    rows = rows[rows["role"] != "yardstick"]
    file = baseline / _HISTORY_FILE
    old = (
        read_history(baseline).table
        if file.is_file()
        else pd.DataFrame(columns=list(_HISTORY_COLUMNS))
    )
    number = int(old["baseline"].max()) + 1 if len(old) else 1
    about = {
        "baseline": number,
        "commit": str(manifest.get("commit") or "")[:12],
        "records": manifest.get("records_hash"),
    }
    size = int(rows["n_all"].max()) if len(rows) else 0
    new = rows[["method", "rank", *_SCORES]].assign(**about, grid=manifest["grid"], scenarios=size)[
        list(_HISTORY_COLUMNS)
    ]
    new = new.round(dict.fromkeys(_SCORES, 4))
    told = ["records", "method", *_SCORES]
    last, same = (
        part[told].reset_index(drop=True).astype(str)
        for part in (old[old["baseline"] == number - 1], new)
    )
    if last.equals(same):
        return
    write_table(pd.concat([old, new], ignore_index=True) if len(old) else new, file)

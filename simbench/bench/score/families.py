"""Valve families: what each method finds of every friction model, and its false alarms on loops
that do not cycle.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from simbench.bench.statistics import wilson
from simbench.bench.store.reading import read_table
from simbench.detectors.verdict import STICTION

if TYPE_CHECKING:
    import pandas as pd


def read(run: str | Path) -> pd.DataFrame:
    """Read a run of grid families as one row per scenario and method."""

    columns = [
        "scenario_id",
        "group",
        "process",
        "valve",
        "disturbance",
        "cycled",
        "oscillating",
        "tags",
    ]
    scenarios = read_table(run, "scenarios", columns).to_pandas()
    scenarios = scenarios[scenarios.cycled.isin(["yes", "no"])]
    scenarios = scenarios.assign(
        cycled=scenarios.cycled == "yes", S=[json.loads(t).get("S") for t in scenarios.tags]
    )
    columns = ["scenario_id", "method", "verdict", "score", "indices", "S_lo", "S_hi"]
    verdicts = read_table(run, "verdicts", columns).to_pandas()
    given = zip(verdicts.indices, verdicts.score, strict=True)
    verdicts = verdicts.assign(
        indices=[{**json.loads(i or "{}"), "score": score} for i, score in given]
    )
    return scenarios.drop(columns="tags").merge(
        verdicts.rename(columns={"verdict": "said"}), on="scenario_id"
    )


def rates(rows: pd.DataFrame) -> pd.DataFrame:
    """Return what each method finds of each family, and its false alarms on loops that do not
    cycle.
    """
    hit = rows.assign(hit=rows.said == STICTION)
    found = hit.groupby(["method", "valve", "cycled"]).hit.agg(["size", "sum"]).reset_index()
    lo, hi = wilson(found["sum"], found["size"])
    found = found.assign(stiction=found["sum"] / found["size"], lo=lo, hi=hi)
    return found.rename(columns={"size": "n", "cycled": "cycling"}).drop(columns="sum")

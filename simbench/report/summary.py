"""Section: what the run says in a few numbers, and the score table."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from markupsafe import Markup

from simbench.bench.score.scoring import FRONT, RAW, Scores
from simbench.html.table import percent, sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Summary"
_SUMMARY_COLUMNS = {
    "cost": "cost",
    "accuracy": "accuracy_applicable",
    "of decided": "accuracy_decided",
    "undecided": "no_decision",
    "found": "found",
    "false alarms": "false_alarms",
    "at 5 %": "found_at_5",
    "AUC": "auc",
}
_SHARES = (*_SUMMARY_COLUMNS, "by sticky", "by predicted", "of all", "applies")
_FORMATS = dict.fromkeys(_SHARES, "{:.3f}".format) | {"rank": "{:.0f}".format}
_FRONTS = {FRONT: "with the oscillation front end", RAW: "without it"}
_PROCESS_TITLES = {"all": "All loops", "self-regulating": "Self-regulating loops", "integrating": "Integrating loops"}


def section(run: RunData) -> Markup:
    """Give size, balance, the best detector with its interval, failures, and all scores."""
    book, mode = run.book, run.scores.first
    cycle = book.truth["cycled"][book.truth["cycled"] >= 0] == 1
    tiles = [
        (f"{book.ids.size}", "scenarios"),
        (percent(float(cycle.mean())) if cycle.size else "-", f"of {cycle.size} clear ones cycle"),
        (f"{len(book.methods)}", "detectors"),
    ]
    ranking = run.scores.ranking()
    fair = ranking[ranking["rank"].notna() & ~ranking["sees_mv"]]
    if len(fair):
        best = fair.iloc[0]
        limits = f"{percent(best['accuracy_applicable_lo'])} to {percent(best['accuracy_applicable_hi'])}"
        tiles.append((percent(best["accuracy_applicable"]), f"right by {best['method']}, the best on OP and PV ({limits})"))
    if not math.isnan(run.scores.resolution):
        tiles.append((f"{run.scores.resolution:.3f}", "smallest difference of cost that this run resolves"))
    tiles.append((str(len(run.errors)), "failures"))
    other = next(m for m in (FRONT, RAW) if m != mode)
    blocks = [(mode, process) for process in _PROCESS_TITLES] + [(other, "all")]
    tables = [(f"{_PROCESS_TITLES[p]}, {_FRONTS[m]}", _readable(run.scores, m, p)) for m, p in blocks]
    return render("summary.html", tiles=tiles, tables=[(says, table) for says, table in tables if table is not None])


def _readable(scores: Scores, mode: str, process: str = "all") -> dict[str, Any] | None:
    """Return one row per detector with the columns a reader compares; None when there are no such loops."""
    ranking = scores.ranking("cycled", mode, process)
    if ranking.empty:
        return None
    uses = [f"{role}, sees MV" if mv else role for role, mv in zip(ranking["role"], ranking["sees_mv"])]
    table = pd.DataFrame({"rank": ranking["rank"].astype(float), "detector": ranking["method"], "for": uses})
    table["applies"] = ranking["applicable"] / ranking["n"]
    beside = {}
    for name, column in _SUMMARY_COLUMNS.items():
        table[name] = ranking[column]
        beside[name] = [f"{lo:.2f}-{hi:.2f}" for lo, hi in zip(ranking[f"{column}_lo"], ranking[f"{column}_hi"])]
    for truth in ("sticky", "predicted"):
        against = scores.ranking(truth, mode, process).set_index("method")["accuracy_applicable"]
        table[f"by {truth}"] = ranking["method"].map(against)
    table["of all"] = ranking["accuracy_all"]
    table["fitted"] = ranking["home"].map({"fitted here": "on this grid", "siblings": "on its siblings"}).fillna("")
    return sortable(table.assign(**{"median (ms)": ranking["median_ms"]}), formats=_FORMATS, beside=beside)

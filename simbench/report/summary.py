"""Section: what the run says in a few numbers, and the score table."""

from __future__ import annotations

from typing import Any

import pandas as pd
from markupsafe import Markup

from simbench.bench.score import FRONT, RAW, Scores
from simbench.html.table import percent, sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Summary"
COLUMNS = {
    "right": "accuracy",
    "right of decided": "decided",
    "undecided": "no_decision",
    "false alarms": "false_alarm",
    "misses": "miss",
    "AUC": "auc",
}
FORMATS = dict.fromkeys([*COLUMNS, "right by sticky", "right by predicted"], "{:.3f}".format)
WORDS = {FRONT: "With the oscillation front end", RAW: "Without it"}


def section(run: RunData) -> Markup:
    """Give size, balance, the best detector with its interval, failures, and all scores.

    Parameters
    ----------
    run : RunData
        The run.

    Returns
    -------
    markupsafe.Markup
    """
    book, mode = run.book, run.scores.first
    clear = book.truth["cycled"] >= 0
    tiles = [
        (f"{book.ids.size}", "scenarios"),
        (percent(float((book.truth["cycled"][clear] == 1).mean())), f"of {int(clear.sum())} clear ones cycle"),
        (f"{len(book.methods)}", "detectors"),
    ]
    ranking = run.scores.ranking()
    fair = ranking[(ranking["role"] == "stiction") & ~ranking["needs_mv"]]
    if len(fair):
        best = fair.iloc[0]
        limits = f"{percent(best['accuracy_lo'])} to {percent(best['accuracy_hi'])}"
        tiles.append((percent(best["accuracy"]), f"right by {best['method']}, the best that sees OP and PV only ({limits})"))
    tiles.append((str(len(run.errors)), "failures"))
    other = next(m for m in (FRONT, RAW) if m != mode)
    return render("summary.html", tiles=tiles, tables=[(WORDS[m], readable(run.scores, m)) for m in (mode, other)])


def readable(scores: Scores, mode: str) -> dict[str, Any]:
    """Return one row per detector with the columns a reader compares.

    Parameters
    ----------
    scores : Scores
        Of the run.
    mode : str
        With or without the oscillation front end.

    Returns
    -------
    dict
        For the `sortable` macro; intervals stand small beside their value.
    """
    ranking = scores.ranking("cycled", mode)
    uses = [f"{role}, sees MV" if mv else role for role, mv in zip(ranking["role"], ranking["needs_mv"])]
    table = pd.DataFrame({"detector": ranking["method"], "for": uses})
    beside = {}
    for name, column in COLUMNS.items():
        table[name] = ranking[column]
        beside[name] = [f"{lo:.2f}-{hi:.2f}" for lo, hi in zip(ranking[f"{column}_lo"], ranking[f"{column}_hi"])]
    for truth in ("sticky", "predicted"):
        against = scores.ranking(truth, mode).set_index("method")["accuracy"]
        table[f"right by {truth}"] = ranking["method"].map(against)
    return sortable(table.assign(**{"median (ms)": ranking["median_ms"]}), formats=FORMATS, beside=beside)

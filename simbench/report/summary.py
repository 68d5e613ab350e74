"""Section: what the run says in a few numbers, and the score table."""

from __future__ import annotations

import pandas as pd
from markupsafe import Markup

from simbench.bench.score import FRONT, RAW, Scores
from simbench.report._table import percent, sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Summary"
COLUMNS = {
    "right": "accuracy", "right of decided": "decided", "undecided": "no_decision", "false alarms": "false_alarm", "misses": "miss",
    "AUC": "auc",
}  # fmt: skip
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
    stiction = ranking[ranking["role"] == "stiction"]
    if len(stiction):
        best = stiction.iloc[0]
        limits = f"{percent(best['accuracy_lo'])} to {percent(best['accuracy_hi'])}"
        tiles.append((percent(best["accuracy"]), f"right by {best['method']}, the best ({limits})"))
    tiles.append((str(len(run.errors)), "failures"))
    other = next(m for m in (FRONT, RAW) if m != mode)
    tables = [(WORDS[m], sortable(readable(run.scores, m), formats=FORMATS)) for m in (mode, other)]
    return render("summary.html", tiles=tiles, tables=tables)


def readable(scores: Scores, mode: str) -> pd.DataFrame:
    """Return one row per detector with the columns a reader compares.

    Parameters
    ----------
    scores : Scores
        Of the run.
    mode : str
        With or without the oscillation front end.

    Returns
    -------
    DataFrame
    """
    ranking = scores.ranking("cycled", mode)
    table = pd.DataFrame({"detector": ranking["method"], "for": ranking["role"]})
    for name, column in COLUMNS.items():
        table[name] = ranking[column]
        if f"{column}_lo" in ranking:
            table[f"{name}, 95 %"] = [f"{lo:.3f} to {hi:.3f}" for lo, hi in zip(ranking[f"{column}_lo"], ranking[f"{column}_hi"])]
    for truth in ("sticky", "predicted"):
        against = scores.ranking(truth, mode).set_index("method")["accuracy"]
        table[f"right by {truth}"] = ranking["method"].map(against)
    return table.assign(**{"median (ms)": ranking["median_ms"]})

"""Everything that a terminal shows of a run's scores: the ranking, then what it leaves out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from simbench.bench.score.names import (
    ALL,
    HOME_MARKS,
    LEAST,
    NO_WAVEFORM,
    OF_NOT_OSCILLATING,
    OF_OSCILLATING,
    ROLE_YARDSTICK,
)
from simbench.bench.score.ranks import loops_needed
from simbench.bench.score.table import (
    PLANNED,
    headline,
    interval_text,
    ranking,
    rate_text,
    why_not,
    wrap,
)
from simbench.detectors.report.report import columns


def full_text(scores: Any, truth: str = "cycled", where: str = "") -> list[str]:
    """Return every table of a run, the whole ranking first."""
    lines = headline(scores, truth, whole=True)
    for process in ("self-regulating", "integrating"):
        rows = scores.rows(truth, process=process)
        if len(rows):
            title = (
                f"oscillating {process} loops, truth {truth!r} ({rows.iloc[0].n},"
                f" {rows.iloc[0].positives} positive)"
            )
            lines += ["", title, *(ranking(rows, scores) if rows.iloc[0].n >= LEAST else [])]
            lines.append(_resolution(scores, truth, process))
    sections = (
        _still(scores, truth),
        _causes(scores),
        _over_no_waveform(scores, truth),
        _details(scores, truth),
        _left_out(scores),
        _dead_band(scores),
        _pair_S_and_J(scores),
        ["labels that disagree", *_lines(scores.disagreement)],
        wrap(where),
    )
    return [*lines, *(line for section in sections if section for line in ("", *section))]


def _resolution(scores: Any, truth: str, process: str) -> str:
    standing = scores.standing[truth, process, OF_OSCILLATING]
    if math.isnan(standing.resolution):
        return f"There is no ranking: {why_not(scores, scores.rows(truth, process=process))}."
    more = " and ".join(f"{d:g} with {loops_needed(d, standing.spread)} loops" for d in PLANNED)
    return (
        f"These loops resolve costs {rate_text(standing.resolution)} apart; 9 of 10 runs would"
        f" resolve {more}."
    )


def _lines(frame: pd.DataFrame) -> list[str]:
    """Return a frame of texts as aligned columns; nothing of an empty one."""
    rows = [tuple(map(str, row)) for row in frame.itertuples(index=False, name=None)]
    return columns([tuple(frame.columns), *rows]) if rows else []


def _rates(rows: pd.DataFrame, titles: Mapping[str, str], n: str = "applicable") -> pd.DataFrame:
    """Return rates of methods as texts, of few loops none; a method has the mark of its home."""
    few = rows[n] < LEAST
    shown = {"method": rows.method + rows.home.map(HOME_MARKS), "n": rows[n]}
    for name, title in titles.items():
        shown[title] = [rate_text(x, some) for x, some in zip(rows[name], few, strict=True)]
    return pd.DataFrame(shown)


def _still(scores: Any, truth: str) -> list[str]:
    """Return the second table: false positives and no decision on loops that do not oscillate."""
    rows = scores.rows(truth, population=OF_NOT_OSCILLATING)
    if rows.empty or rows.iloc[0].n < LEAST:
        return []
    title = f"loops that do not oscillate ({rows.iloc[0].n}, {rows.iloc[0].positives} positive)"
    titles = {"false_positives": "false positives", "no_decision": "no decision"}
    return [title, *_lines(_rates(rows[rows.role != ROLE_YARDSTICK], titles))]


def _causes(scores: Any) -> list[str]:
    """Return false positives by what makes a loop oscillate whose valve does not."""
    rows = _at_home(scores, scores.by_cause)
    if rows.empty:
        return []
    of_each = "; ".join(f"{c} {n}" for c, n in rows.groupby("cause", sort=False).n.max().items())
    table = _rates(rows, {"false_positives": "share"}, "n").assign(cause=rows.cause)
    wide = table.pivot(index="method", columns="cause", values="share").fillna("")
    wide = wide.loc[table.method.unique(), rows.cause.unique()].reset_index()
    title = f"false positives by cause, loops that the valve does not make cycle ({of_each})"
    return [*wrap(title), *_lines(wide)]


def _at_home(scores: Any, rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows of methods that could be ranked, with the home of each; of loops left out alone
    there are others.
    """
    if rows.empty:
        return rows
    homes = dict(zip(scores.table.method, scores.table.home, strict=True))
    return rows[rows.role != ROLE_YARDSTICK].assign(home=lambda r: r.method.map(homes).fillna(""))


def _over_no_waveform(scores: Any, truth: str) -> list[str]:
    rows = scores.rows(truth)
    rows = rows[(rows.kind < 2) & (rows.applicable >= LEAST)]
    rows = rows[rows.cost_over_no_waveform.notna()]
    if rows.empty:
        return []
    lo = rows.cost_over_no_waveform_lo
    hi = rows.cost_over_no_waveform_hi
    table = _rates(rows, {})
    table["cost over no_waveform"] = rows.cost_over_no_waveform.map("{:+.2f}".format)
    table["95 %"] = lo.map("{:+.2f}".format) + " to " + hi.map("{:+.2f}".format)
    answers = np.select([hi < 0, lo > 0], ["yes", "no"], "cannot tell")
    table[f"less than {NO_WAVEFORM}"] = answers
    return [f"cost less that of {NO_WAVEFORM} on the same oscillating loops", *_lines(table)]


def _details(scores: Any, truth: str) -> list[str]:
    """Return what the headline leaves out, over all loops."""
    rows = scores.rows(truth, population=ALL)
    if rows.empty:
        return [f"no loop has a clear label against {truth!r}"]
    titles = {
        **{"cost": "cost", "accuracy": "accuracy", "no_decision": "no decision"},
        **{"sensitivity_at_5": "sens. at 5 %", "auc": "AUC", "risk_coverage": "risk"},
        "accuracy_all": "of all",
    }
    table = _rates(rows, titles)
    unranked = np.where(rows.kind > 1, "", "-")
    ranks = np.where(rows["rank"].isna(), unranked, rows["rank"].map("{:.0f}".format))
    table.insert(0, "rank", ranks)
    title = f"all loops, truth {truth!r} ({rows.iloc[0].n}, {rows.iloc[0].positives} positive)"
    legend = (
        "sens. at 5 %: sensitivity at 5 % false positives, threshold from other groups; risk: area"
        " under the risk-coverage curve; of all: accuracy, not-applicable counted as wrong"
    )
    return [title, *_lines(table), *wrap(legend)]


def _left_out(scores: Any) -> list[str]:
    rows = _at_home(scores, scores.left_out)
    rows = rows[rows.n > 0] if len(rows) else rows
    if rows.empty:
        return []
    titles = {"no_stiction": "no stiction", "no_decision": "no decision"}
    table = _rates(rows, titles, "n")
    ends = zip(rows.stiction, rows.stiction_lo, rows.stiction_hi, rows.n < LEAST, strict=True)
    table.insert(1, "loops", rows.of)
    table.insert(3, "stiction", [interval_text(*shares) for shares in ends])
    title = (
        "not in any row above: answers on entrained and unclear loops, and on those a method does"
        " not apply to"
    )
    return [title, *_lines(table)]


def _dead_band(scores: Any) -> list[str]:
    rows = scores.by_axis
    rows = rows[(rows.axis == "S_over_2J") & (rows.value == "inf") & (rows.positives > 0)]
    rows = rows[(rows.role != ROLE_YARDSTICK) & (rows.applicable > 0)]
    if rows.empty:
        return []
    found = ", ".join(
        f"{r.method}{HOME_MARKS[r.home]} {rate_text(r.sensitivity)}"
        for r in rows.itertuples()
        if not math.isnan(r.sensitivity)
    )
    return wrap(f"sensitivity on dead-band alone ({int(rows.positives.max())} cycling): {found}")


def _pair_S_and_J(scores: Any) -> list[str]:
    """Return S and J side by side, one row for a method on a family of valves."""
    rows = scores.quantification
    rows = rows[rows.n >= LEAST]
    if rows.empty:
        return []
    names = {r.method: r.method + HOME_MARKS[r.home] for r in scores.table.itertuples()}
    table = pd.DataFrame({"method": rows.method.replace(names), "family": rows.family})
    table = table.drop_duplicates().set_index(["method", "family"])
    for p in "SJ":
        mine = rows[rows.parameter == p].set_index(["method", "family"]).rename(index=names)
        table[f"n {p}"] = mine.n.astype(str)
        for name, title in (("median_error", "error"), ("coverage", "held"), ("width", "width")):
            table[f"{title} {p}"] = mine[name].map("{:.3f}".format).replace("nan", "-")
    text = (
        "S and J of sticky loops by family of valves: median error and width in shares of the"
        " valve's S; held: share of the intervals that hold the truth, nominally nine in ten; -"
        " where a method states no level."
    )
    return [*wrap(text), *_lines(table.fillna("-").reset_index())]

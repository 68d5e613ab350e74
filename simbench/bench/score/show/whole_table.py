"""Everything that a terminal shows of a run's scores: the ranking, then what it leaves out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

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
from simbench.bench.score.show.table import (
    PLANNED,
    headline,
    interval_text,
    ranking,
    rate_text,
    why_not,
    wrap,
)
from simbench.detectors.report.report import columns

if TYPE_CHECKING:
    import pandas as pd


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
        ["labels that disagree", *_align_frame(scores.disagreement)],
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


def _still(scores: Any, truth: str) -> list[str]:
    """Return the second table: false positives and no decision on loops that do not oscillate."""
    rows = scores.rows(truth, population=OF_NOT_OSCILLATING)
    if rows.empty or rows.iloc[0].n < LEAST:
        return []
    first = rows.iloc[0]
    lines = [("method", "n", "false positives", "no decision")]
    for r in rows[rows.role != ROLE_YARDSTICK].itertuples():
        few = r.applicable < LEAST
        rates = (r.false_positives, r.no_decision)
        lines.append(
            (r.method + HOME_MARKS[r.home], str(r.applicable), *(rate_text(x, few) for x in rates))
        )
    title = f"loops that do not oscillate ({first.n}, {first.positives} positive)"
    return [title, *columns(lines)]


def _causes(scores: Any) -> list[str]:
    """Return false positives by what makes a loop oscillate whose valve does not."""
    rows = scores.by_cause
    names = _mark_methods(scores)
    rows = rows[rows.role != ROLE_YARDSTICK] if len(rows) else rows
    causes = list(dict.fromkeys(rows.cause)) if len(rows) else []
    lines = [("method", *causes)]
    for method, of in rows.groupby("method", sort=False) if causes else ():
        known = {r.cause: rate_text(r.false_positives, r.n < LEAST) for r in of.itertuples()}
        lines.append((names.get(method, method), *(known.get(c, "") for c in causes)))
    of_each = "; ".join(f"{c} {rows[rows.cause == c].n.max()}" for c in causes)
    title = f"false positives by cause, loops that the valve does not make cycle ({of_each})"
    return [*wrap(title), *columns(lines)] if causes else []


def _over_no_waveform(scores: Any, truth: str) -> list[str]:
    rows = scores.rows(truth)
    rows = rows[(rows.kind < 2) & (rows.applicable >= LEAST)]
    rows = rows[rows.cost_over_no_waveform.notna()]
    lines = [("method", "n", "cost over no_waveform", "95 %", "less than no_waveform")]
    for r in rows.itertuples():
        lo = r.cost_over_no_waveform_lo
        hi = r.cost_over_no_waveform_hi
        answer = "yes" if hi < 0 else "no" if lo > 0 else "cannot tell"
        cells = (
            str(r.applicable),
            f"{r.cost_over_no_waveform:+.2f}",
            f"{lo:+.2f} to {hi:+.2f}",
            answer,
        )
        lines.append((r.method + HOME_MARKS[r.home], *cells))
    title = f"cost less that of {NO_WAVEFORM} on the same oscillating loops"
    return [title, *columns(lines)] if len(lines) > 1 else []


def _details(scores: Any, truth: str) -> list[str]:
    """Return what the headline leaves out, over all loops."""
    rows = scores.rows(truth, population=ALL)
    if rows.empty:
        return [f"no loop has a clear label against {truth!r}"]
    lines = [
        (
            "rank",
            "method",
            "n",
            "cost",
            "accuracy",
            "no decision",
            "sens. at 5 %",
            "AUC",
            "risk",
            "of all",
        )
    ]
    for r in rows.itertuples():
        few = r.applicable < LEAST
        none = math.isnan(r.rank)
        rates = (
            r.cost,
            r.accuracy,
            r.no_decision,
            r.sensitivity_at_5,
            r.auc,
            r.risk_coverage,
            r.accuracy_all,
        )
        rank = ("" if r.kind > 1 else "-") if none else f"{r.rank:.0f}"
        lines.append(
            (
                rank,
                r.method + HOME_MARKS[r.home],
                str(r.applicable),
                *(rate_text(x, few) for x in rates),
            )
        )
    first = rows.iloc[0]
    title = f"all loops, truth {truth!r} ({first.n}, {first.positives} positive)"
    legend = (
        "sens. at 5 %: sensitivity at 5 % false positives, threshold from other groups; risk: area"
        " under the risk-coverage curve; of all: accuracy, not-applicable counted as wrong"
    )
    return [title, *columns(lines), *wrap(legend)]


def _mark_methods(scores: Any) -> dict[str, str]:
    """Return the names of the methods that are scored, with their marks; of loops left out alone
    there are others.
    """
    return {r.method: r.method + HOME_MARKS[r.home] for r in scores.table.itertuples()}


def _left_out(scores: Any) -> list[str]:
    rows = scores.left_out
    names = _mark_methods(scores)
    rows = rows[(rows.role != ROLE_YARDSTICK) & (rows.n > 0)] if len(rows) else rows
    lines = [("method", "loops", "n", "stiction", "no stiction", "no decision")]
    for r in rows.itertuples():
        few = r.n < LEAST
        yes = interval_text(r.stiction, r.stiction_lo, r.stiction_hi, few)
        shares = (yes, rate_text(r.no_stiction, few), rate_text(r.no_decision, few))
        lines.append((names.get(r.method, r.method), r.of, str(r.n), *shares))
    title = (
        "not in any row above: answers on entrained and unclear loops, and on those a method does"
        " not apply to"
    )
    return [title, *columns(lines)] if len(lines) > 1 else []


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
    t = scores.quantification
    names = _mark_methods(scores)
    lines = [
        (
            "method",
            "family",
            *(f"{what} {p}" for p in "SJ" for what in ("n", "error", "held", "width")),
        )
    ]
    for key, rows in t[t.n >= LEAST].groupby(["method", "family"], sort=False):
        method, family = tuple(key)  # type: ignore[arg-type]
        found = {
            r.parameter: (str(r.n), *map(_three_digits, (r.median_error, r.coverage, r.width)))
            for r in rows.itertuples()
        }
        lines.append(
            (
                names.get(method, method),
                family,
                *found.get("S", ("-",) * 4),
                *found.get("J", ("-",) * 4),
            )
        )
    if len(lines) == 1:
        return []
    text = (
        "S and J of sticky loops by family of valves: median error and width in shares of the"
        " valve's S; held: share of the intervals that hold the truth, nominally nine in ten; -"
        " where a method states no level."
    )
    return [*wrap(text), *columns(lines)]


def _three_digits(x: float) -> str:
    return "-" if math.isnan(x) else f"{x:.3f}"


def _align_frame(frame: pd.DataFrame) -> list[str]:
    return columns(
        [tuple(frame.columns), *(tuple(map(str, row)) for row in frame.itertuples(index=False))]
    )

"""Text tables of a run's scores: the ranking on oscillating loops, and every other table on
request.

`scores` is a `simbench.bench.score.result.Scores`, which prints itself by these functions.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from simbench.bench.score.names import (
    ALL,
    CONSTANTS,
    HOME_MARKS,
    LEAST,
    NO_WAVEFORM,
    OF_NOT_OSCILLATING,
    OF_OSCILLATING,
    ROLE_YARDSTICK,
    SAMPLED,
    loops_of,
)
from simbench.bench.score.ranks import RANKED_LOOPS, loops_needed
from simbench.bench.score.shipped import UNLIKE
from simbench.bench.store.benchmark import benchmark_text
from simbench.bench.store.manifest import unmatched
from simbench.detectors.report.report import columns

if TYPE_CHECKING:
    import pandas as pd

# of the default output
_LINES = 30
_WIDTH = 100  # characters
# lines that a command prints around the table: what failed, the run's folder
_BESIDES = 2
_PLANNED = (0.01, 0.03)  # differences for which the full text tells how many loops they take
HEAD = ("rank", "method", "cost", "accuracy", "sensitivity", "false positives", "no decision")
_TRUTHS = {
    "cycled": "the valve makes the loop cycle",
    "predicted": "Table 11.3 predicts a limit cycle",
    "sticky": "the valve has friction",
}
_LEGEND = (
    "Cost: an error 1, no decision {undecided:g}; ranges: 95 % intervals; * fitted here, + on loops"
    " like these."
)
_NO_REFERENCES = (
    "Rows no_waveform and rhythm need the records, which are not stored here: `simbench run` of the"
    " grid has them."
)
_REFERENCES = (
    "no_waveform: a classifier that sees period, amplitude and noise, but no waveform; rhythm: and"
    " how regular the cycles are."
)


def headline(scores: Any, truth: str = "cycled", where: str = "", whole: bool = False) -> list[str]:
    """Return one table of at most 30 lines and 100 columns, the ranking on oscillating loops, and
    three sentences; `whole`: with every method.
    """
    title = _title(scores, whole)
    rows = scores.rows(truth)
    if rows.empty:
        return [*title, *_sentences(scores, truth, where)]
    first = rows.iloc[0]
    title += _wrap(
        f"{first.n} loops have a clear label and oscillate; in {first.positives} {_TRUTHS[truth]}"
        f" (truth {truth!r})."
    )
    tail = [
        *_wrap(_LEGEND.format(undecided=scores.undecided)),
        *_references(rows, whole),
        *_sentences(scores, truth, where, whole),
    ]
    room = 10_000 if whole else _LINES - _BESIDES - len(title) - len(tail) - 2
    return [*title, "", *_ranking(rows, scores, room), *tail]


def _references(rows: pd.DataFrame, whole: bool) -> list[str]:
    """Return what the reference rows are; where a run was stored without what they see, that."""
    if NO_WAVEFORM not in rows.method.tolist():
        return _wrap(_NO_REFERENCES)
    return _wrap(_REFERENCES) if whole else []


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
            lines += ["", title, *(_ranking(rows, scores) if rows.iloc[0].n >= LEAST else [])]
            lines.append(_resolution(scores, truth, process))
    sections = (
        _still(scores, truth),
        _causes(scores),
        _resolved_corners(scores),
        _over_no_waveform(scores, truth),
        _details(scores, truth),
        _left_out(scores),
        _dead_band(scores),
        _pair_S_and_J(scores),
        ["labels that disagree", *_align_frame(scores.disagreement)],
        _wrap(where),
    )
    return [*lines, *(line for section in sections if section for line in ("", *section))]


def along_lines(rates: pd.DataFrame, axes: Sequence[str], grid: str) -> list[str]:
    """Return how the methods depend on an axis of the grid, a line per value and method."""
    lines = [(axes[0], "method", "n", "accuracy", "sensitivity", "false positives", "no decision")]
    for r in rates.to_dict("records"):
        few = r["n"] < LEAST
        shares = [
            _interval(r[name], r[f"{name}_lo"], r[f"{name}_hi"], few)
            for name in ("accuracy", "sensitivity", "false_positives")
        ]
        counts = (str(r[axes[0]]), r["method"], str(r["n"]))
        lines.append((*counts, *shares, _rate(r["no_decision"], few)))
    about = f"grid {grid}, all loops with a label; -: fewer than {LEAST} loops, or no such loop"
    return [*_wrap(about), *columns(lines)]


def two_way_lines(
    rates: pd.DataFrame, axes: Sequence[str], grid: str, shares: Sequence[str] = ("accuracy",)
) -> list[str]:
    """Return some shares of each method over two axes, the first down and the second across."""
    down, across = axes
    more = "" if len(shares) > 1 else "; --method ID: sensitivity and false positives of one, too"
    lines = _wrap(
        f"grid {grid}: {_list_in_words(shares)} and number of loops, {down} down and {across}"
        f" across; in brackets: fewer than {LEAST} loops{more}"
    )
    values = list(dict.fromkeys(rates[across]))
    for method, of in rates.groupby("method", sort=False):
        for name in shares:
            title = str(method) if len(shares) == 1 else f"{method}: {name.replace('_', ' ')}"
            rows: list[tuple[str, ...]] = [(title, *values)]
            for value, line in of.groupby(down, sort=False):
                known = {r[across]: _cell(r[name], loops_of(r, name)) for _, r in line.iterrows()}
                rows.append((str(value), *(known.get(v, "-") for v in values)))
            lines += ["", *columns(rows)]
    return lines


def _list_in_words(shares: Sequence[str]) -> str:
    """Return the names of shares in words.

    >>> _list_in_words(["accuracy", "sensitivity", "false_positives"])
    'accuracy, sensitivity, false positives'
    """
    return ", ".join(name.replace("_", " ") for name in shares)


def _cell(share: float, n: int) -> str:
    """Return a share with the number of loops it is of.

    >>> _cell(0.5, 24), _cell(0.5, 12), _cell(math.nan, 0)
    ('.50 24', '(.50) 12', '-')
    """
    if math.isnan(share):
        return "-"
    return f"({_rate(share)}) {n}" if n < LEAST else f"{_rate(share)} {n}"


def _title(scores: Any, whole: bool) -> list[str]:
    """Return what a run is; of the `whole` text also how many loops cycle and were left out."""
    m = scores.manifest
    counts = scores.counts
    about = (
        f"grid {m['grid']} ({m['grid_hash']}), {counts['scenarios']} scenarios, seed"
        f" {m.get('seed')}{benchmark_text(m)}"
    )
    lines = _wrap(about)
    if unlike := m.get(UNLIKE):
        lines += _wrap(
            f"{unlike} records have other last bits than those of the shipped verdicts, as on"
            " another processor."
        )
    if SAMPLED in counts:
        lines += _wrap(
            "Rates and costs are of all loops. Their scatter, areas under curves, sensitivity at 5"
            f" % and classifier no_waveform rest on {counts[SAMPLED]} scenarios, drawn at random."
        )
    if not whole:
        return lines
    words = (
        scores.disagreement.groupby("cycled").scenarios.sum() if len(scores.disagreement) else {}
    )
    said = ", ".join(
        f"{words.get(word, 0)} {word}" for word in ("yes", "no", "entrained", "unclear")
    )
    lines += _wrap(
        f"{counts[OF_OSCILLATING]} loops oscillate. Of all loops, the valve makes the loop cycle:"
        f" {said}."
    )
    if left_out := unmatched(m):
        lines += _wrap(
            f"{left_out} {'echo was' if left_out == 1 else 'echoes were'} left out, as the sticky"
            " sibling does not cycle."
        )
    return lines


def _sentences(scores: Any, truth: str, where: str, whole: bool = False) -> list[str]:
    """Return which differences are resolved, and where the report is."""
    standing = scores.standing[truth, ALL, OF_OSCILLATING]
    rows = scores.rows(truth)
    said = [
        f"Not ranked, too many errors: {m} failed on {k} records."
        for m, k in scores.failing.items()
    ]
    if math.isnan(standing.resolution):
        said.append(f"There is no ranking: {_why_not(scores, rows)}.")
    elif not scores.chosen and _rivals(rows) < 2:
        said.append("Only one method covers these loops, so it has no rival to be ranked against.")
    else:
        ranks = (
            "Rank 1: no method costs less by a difference that these loops resolve; 2: only methods"
            " of rank 1 do; and so on. "
        )
        resolved = f"A difference of {_rate(standing.resolution)} is resolved between any two."
        said.append(ranks * whole + resolved)
    return [line for sentence in (*said, where) for line in _wrap(sentence)]


def _rivals(rows: pd.DataFrame) -> int:
    """Return how many methods are ranked with each other on the same loops."""
    ranked = rows[(rows.kind < 2) & rows["rank"].notna() & ~rows.partial]
    return int(ranked.kind.value_counts().max()) if len(ranked) else 0


def _why_not(scores: Any, rows: pd.DataFrame) -> str:
    n = 0 if rows.empty else int(rows.iloc[0].n)
    if n < RANKED_LOOPS:
        return f"{n} oscillating loops have a clear label, and {RANKED_LOOPS} are needed"
    judged = rows[(rows.kind < 2) & ~rows.method.isin(list(scores.failing))]
    if judged.empty:
        return "no method that could be ranked judged these loops"
    most = judged.loc[judged.applicable.idxmax()]
    return f"no method answers 90 % of the {n} loops; {most.method} answers {most.applicable}"


def _ranking(rows: pd.DataFrame, scores: Any, room: int = 10_000) -> list[str]:
    """Return a ranking, within so many lines below its head; what reference rows cannot spare the
    last methods do.
    """
    body: list[tuple[str, Any]] = []
    before = ""
    for r in rows.itertuples():
        if r.group != before:
            body.append(("title", f"-- {r.group}"))
        body.append(("always" if r.method in CONSTANTS else "fixed" if r.kind == 2 else "row", r))
        before = r.group
    if len(body) > room:
        body = [(kind, r) for kind, r in body if kind != "always"]
    # the user's own methods stay
    spare = [k for k, (kind, r) in enumerate(body) if kind == "row" and not r.own][::-1][
        : max(len(body) + 1 - room, 0)
    ]
    dropped = set(spare) if len(body) > room else set()
    shown = [k for k in range(len(body)) if k not in dropped]
    headings = {
        k
        for k, after in zip(shown, [*shown[1:], None], strict=True)
        if body[k][0] == "title" and (after is None or body[after][0] == "title")
    }
    lines = _cells([r for k, (kind, r) in enumerate(body) if kind != "title" and k not in dropped])
    out = [lines[0]]
    cells = iter(lines[1:])
    for k, (kind, r) in enumerate(body):
        if k not in dropped | headings:
            out.append(r if kind == "title" else next(cells))
    return [*out, *([f"... and {len(dropped)} more methods: --full"] if dropped else [])]


def _cells(rows: Sequence[Any]) -> list[str]:
    """Return a head and one line a row; of too wide a table the intervals of all but the cost are
    left out.
    """
    for shown in (_interval, lambda value, lo, hi, few: _rate(value, few)):
        lines = [HEAD]
        for r in rows:
            few = r.applicable < LEAST
            rank = math.isnan(r.rank)
            lines.append(
                (
                    ("" if r.kind > 1 else "-") if rank else f"{r.rank:.0f}",
                    r.method + HOME_MARKS[r.home],
                    _interval(r.cost, r.cost_lo, r.cost_hi, few),
                    shown(
                        r.accuracy,
                        r.accuracy_lo,
                        r.accuracy_hi,
                        few,
                    ),
                    _rate(r.sensitivity, few),
                    _rate(r.false_positives, few),
                    shown(r.no_decision, r.no_decision_lo, r.no_decision_hi, few),
                )
            )
        text = columns(lines)
        if max(map(len, text)) <= _WIDTH:
            break
    return text


def _resolution(scores: Any, truth: str, process: str) -> str:
    standing = scores.standing[truth, process, OF_OSCILLATING]
    if math.isnan(standing.resolution):
        return f"There is no ranking: {_why_not(scores, scores.rows(truth, process=process))}."
    more = " and ".join(f"{d:g} with {loops_needed(d, standing.spread)} loops" for d in _PLANNED)
    return (
        f"These loops resolve costs {_rate(standing.resolution)} apart; 9 of 10 runs would resolve"
        f" {more}."
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
            (r.method + HOME_MARKS[r.home], str(r.applicable), *(_rate(x, few) for x in rates))
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
        known = {r.cause: _rate(r.false_positives, r.n < LEAST) for r in of.itertuples()}
        lines.append((names.get(method, method), *(known.get(c, "") for c in causes)))
    of_each = "; ".join(f"{c} {rows[rows.cause == c].n.max()}" for c in causes)
    title = f"false positives by cause, loops that the valve does not make cycle ({of_each})"
    return [*_wrap(title), *columns(lines)] if causes else []


def _resolved_corners(scores: Any) -> list[str]:
    """Return which share of the echoes is called sticky, over the frequency at which they end, and
    which of their sticky siblings.
    """
    rows = scores.resolution_curve()
    names = _mark_methods(scores)
    if rows.empty:
        return []
    cuts = sorted(rows["cut"].unique())
    lines = [("method", *(f"{cut:g}" for cut in cuts), "sticky", "told apart")]
    for method, of in rows.groupby("method", sort=False):
        known = {r.cut: _rate(r.called, r.n < LEAST) for r in of.itertuples()}
        one = of.iloc[0]
        sticky = _rate(one.called_siblings, one.siblings < LEAST)
        apart = f"{one.told_apart:.2f} ({one.told_apart_lo:.2f} to {one.told_apart_hi:.2f})"
        shares = (known.get(cut, "") for cut in cuts)
        lines.append((names.get(method, method), *shares, sticky, apart))
    title = _wrap(
        "resolution: share of echoes called sticky, over the multiple of the cycle's frequency"
        " above which nothing of the valve's error is left; of their sticky siblings; and the"
        " difference, its mean over these, with a 95 % interval"
    )
    return [*title, *columns(lines)]


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
                *(_rate(x, few) for x in rates),
            )
        )
    first = rows.iloc[0]
    title = f"all loops, truth {truth!r} ({first.n}, {first.positives} positive)"
    legend = (
        "sens. at 5 %: sensitivity at 5 % false positives, threshold from other groups; risk: area"
        " under the risk-coverage curve; of all: accuracy, not-applicable counted as wrong"
    )
    return [title, *columns(lines), *_wrap(legend)]


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
        yes = _interval(r.stiction, r.stiction_lo, r.stiction_hi, few)
        shares = (yes, _rate(r.no_stiction, few), _rate(r.no_decision, few))
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
        f"{r.method}{HOME_MARKS[r.home]} {_rate(r.sensitivity)}"
        for r in rows.itertuples()
        if not math.isnan(r.sensitivity)
    )
    return _wrap(f"sensitivity on dead-band alone ({int(rows.positives.max())} cycling): {found}")


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
    return [*_wrap(text), *columns(lines)]


def _rate(x: float, few: bool = False) -> str:
    return (
        "-"
        if few or math.isnan(x)
        else f"{x:.2f}".replace("0.", ".", 1)
        if x < 0.995
        else f"{x:.2f}"
    )


def _interval(value: float, lo: float, hi: float, few: bool = False) -> str:
    return "-" if few or math.isnan(value) else f"{_rate(value)} {_rate(lo)}-{_rate(hi)}"


def _three_digits(x: float) -> str:
    return "-" if math.isnan(x) else f"{x:.3f}"


def _wrap(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH)


def _align_frame(frame: pd.DataFrame) -> list[str]:
    return columns(
        [tuple(frame.columns), *(tuple(map(str, row)) for row in frame.itertuples(index=False))]
    )

"""Text tables of a run's scores: the ranking on oscillating loops, and every other table on
request.

`scores` is a `simbench.bench.score.result.Scores`, which prints itself by these functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

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
from simbench.bench.store.benchmark import FROM_RECORDS, benchmark_text
from simbench.bench.store.manifest import UNANSWERED, unmatched
from simbench.bench.store.reading import COPIES
from simbench.page.text import LINE_WIDTH, lines_of, wrap

# of the default output
_LINES = 30
# lines that a command prints around the table: what failed, the run's folder
_BESIDES = 2
_RIVALS = 4  # names of methods that the advice holds at most
PLANNED = (0.01, 0.03)  # differences for which the full text tells how many loops they take
# rates by the name of their column
_TITLES = {
    name: name.replace("_", " ")
    for name in ("cost", "accuracy", "sensitivity", "false_positives", "no_decision")
}
_TRUTHS = {
    "cycled": "the valve makes the loop cycle",
    "predicted": "Table 11.3 predicts a limit cycle",
    "sticky": "the valve has friction",
}
_LEGEND = (
    "Cost: an error 1, no decision {undecided:g}; ranges: 95 % intervals; * fitted here, + on loops"
    " like these."
)
NO_REFERENCES = (
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
    # above the ranking: advice, the run, what counts as stiction
    rows = scores.rows(truth)
    title = _advise_on_methods(scores, rows) + _describe_run(scores, whole)
    if rows.empty:
        return title + _closing_sentences(scores, truth, where)
    title += _label_ranking(rows, truth)

    # below it: what the columns mean, and which differences are resolved
    tail = (
        wrap(_LEGEND.format(undecided=scores.undecided))
        + _describe_references(rows, whole)
        + _closing_sentences(scores, truth, where, whole)
    )

    # as many methods as a screen has room for
    if whole:
        room = 10_000
    else:
        room = _LINES - _BESIDES - len(title) - len(tail) - 2
    return title + [""] + ranking(rows, scores, room) + tail


def opening_lines(scores: Any, truth: str) -> list[str]:
    """Return the sentences around a ranking, a paragraph each."""
    rows = scores.rows(truth)
    parts = (
        _advise_on_methods(scores, rows),
        _describe_run(scores, True),
        _label_ranking(rows, truth) if len(rows) else [],
    )
    around = parts + (_describe_references(rows, True), _closing_sentences(scores, truth, ""))
    return [" ".join(filter(None, lines)) for lines in around if lines]


def _label_ranking(rows: pd.DataFrame, truth: str) -> list[str]:
    """Return how many loops the ranking is on, and what counts as stiction."""
    first = rows.iloc[0]
    return wrap(
        f"{first.n} loops have a clear label and oscillate; in {first.positives} {_TRUTHS[truth]}"
        f" (truth {truth!r})."
    )


def _advise_on_methods(scores: Any, rows: pd.DataFrame) -> list[str]:
    """Return on which method to rely for loops like those of a run that was made from records, or
    that none is worth more than no answer; nothing of another run, or of some methods alone.
    """
    source = scores.manifest.get("grid_content", {}).get("source")
    if source != FROM_RECORDS or scores.chosen:
        return []

    # records of a plant seldom have MV: methods that see OP and PV are advised alone
    if rows.empty:
        ranked = rows
    else:
        ranked = rows[(rows.kind == 0) & rows["rank"].notna()]
    if ranked.empty:
        why = why_not(scores, rows)
        return wrap(f"Which method to rely on for loops like these is unknown: {why}.") + [""]

    # how right the first method is, and from which others these loops do not tell it
    best = ranked.iloc[0]
    wrong = max(1.0 - best.accuracy - best.no_decision, 0.0)
    about = (
        f"on {best.applicable} simulations of loops like these {best.method} is right in"
        f" {best.accuracy:.0%} and wrong in {wrong:.0%}"
    )
    if same := ranked.loc[ranked["rank"] == 1, "method"].tolist()[1:]:
        about += f"; these loops do not tell it from {' and '.join(same[:_RIVALS])}"
        about += f" and {len(same) - _RIVALS} more" * (len(same) > _RIVALS)

    # a method that never decides costs as much as no answer
    if best.cost_hi < scores.undecided:
        return wrap(f"Rely on {best.method} for such loops: {about}.") + [""]
    return wrap(f"No method is known to be worth more here than no answer: {about}.") + [""]


def _describe_references(rows: pd.DataFrame, whole: bool) -> list[str]:
    """Return what the reference rows are; where a run was stored without what they see, that."""
    if NO_WAVEFORM not in rows.method.tolist():
        return wrap(NO_REFERENCES)
    if whole:
        return wrap(_REFERENCES)
    return []


def along_lines(rates: pd.DataFrame, axes: Sequence[str], grid: str) -> list[str]:
    """Return how the methods depend on an axis of the grid, a line per value and method."""
    titles = {}
    for name, title in _TITLES.items():
        if name != "cost":
            titles[name] = title
    table = _format_rates(
        rates, titles, "n", intervals=("accuracy", "sensitivity", "false_positives")
    )
    table.insert(0, axes[0], rates[axes[0]])
    about = f"grid {grid}, all loops with a label; -: fewer than {LEAST} loops, or no such loop"
    return wrap(about) + lines_of(table)


def two_way_lines(
    rates: pd.DataFrame, axes: Sequence[str], grid: str, shares: Sequence[str] = ("accuracy",)
) -> list[str]:
    """Return some shares of each method over two axes, the first down and the second across."""
    # what the tables hold
    down, across = axes
    more = "" if len(shares) > 1 else "; --method ID: sensitivity and false positives of one, too"
    names = ", ".join(_TITLES[name] for name in shares)
    lines = wrap(
        f"grid {grid}: {names} and number of loops, {down} down and {across} across; in brackets:"
        f" fewer than {LEAST} loops{more}"
    )

    # a table for each method and share, the axes in their order
    values = rates[across].unique()
    for method, of in rates.groupby("method", sort=False):
        for name in shares:
            if len(shares) == 1:
                title = str(method)
            else:
                title = f"{method}: {_TITLES[name]}"
            cells = [_format_cell(r[name], loops_of(r, name)) for r in of.to_dict("records")]
            square = of.assign(cell=cells).pivot(index=down, columns=across, values="cell")
            square = square.reindex(of[down].unique()).reindex(columns=values).fillna("-")
            square.insert(0, title, square.index)
            lines += [""] + lines_of(square)
    return lines


def _format_cell(share: float, n: int) -> str:
    """Return a share with the number of loops it is of.

    >>> _format_cell(0.5, 24), _format_cell(0.5, 12), _format_cell(math.nan, 0)
    ('.50 24', '(.50) 12', '-')
    """
    if math.isnan(share):
        return "-"
    if n < LEAST:
        return f"({rate_text(share)}) {n}"
    return f"{rate_text(share)} {n}"


def _describe_run(scores: Any, whole: bool) -> list[str]:
    """Return what a run is; of the `whole` text also how many loops cycle and were left out."""
    # the run, and what is particular about it
    m = scores.manifest
    counts = scores.counts
    about = (
        f"grid {m['grid']} ({m['grid_hash']}), {counts['scenarios']} scenarios, seed"
        f" {m.get('seed')}{benchmark_text(m)}"
    )
    lines = wrap(about)
    if unlike := m.get(UNLIKE):
        lines += wrap(
            f"{unlike} records have other last bits than those of the shipped verdicts, as on"
            " another processor."
        )
    if copies := m.get(COPIES):
        lines += wrap(
            f"{copies} of {copies + counts['scenarios']} loops have the record of another bit for"
            " bit and the same labels: each record counts once."
        )
    if SAMPLED in counts:
        lines += wrap(
            "Rates and costs are of all loops. Their scatter, areas under curves, sensitivity at 5"
            f" % and classifier no_waveform rest on {counts[SAMPLED]} scenarios, drawn at random."
        )

    # healthy loops that no sticky one stands for
    if left_out := unmatched(m):
        lines += wrap(
            f"{left_out} {'echo was' if left_out == 1 else 'echoes were'} left out, as the sticky"
            " sibling does not cycle."
        )
    if not whole:
        return lines

    # how many of its loops cycle
    lines[-1] += "." * (not lines[-1].endswith("."))
    if len(scores.disagreement):
        words = scores.disagreement.groupby("cycled").scenarios.sum()
    else:
        words = {}
    said = ", ".join(
        f"{words.get(word, 0)} {word}" for word in ("yes", "no", "entrained", "unclear")
    )
    lines += wrap(
        f"{counts[OF_OSCILLATING]} loops oscillate. Of all loops, the valve makes the loop cycle:"
        f" {said}."
    )
    return lines


def _closing_sentences(scores: Any, truth: str, where: str, whole: bool = False) -> list[str]:
    """Return which differences are resolved, and where the report is."""
    # methods without a rank
    standing = scores.standing[truth, ALL, OF_OSCILLATING]
    rows = scores.rows(truth)
    said = []
    for m, k in scores.failing.items():
        said.append(f"Not ranked, too many errors: {m} failed on {k} records.")
    for m, about in scores.manifest["methods"].items():
        if about.get(UNANSWERED):
            said.append(
                f"The file of {m} leaves {about[UNANSWERED]} records unanswered: no decision."
            )

    # what the ranks tell, or why there are none
    if math.isnan(standing.resolution):
        said.append(f"There is no ranking: {why_not(scores, rows)}.")
    elif not scores.chosen and _count_rivals(rows) < 2:
        said.append("Only one method covers these loops, so it has no rival to be ranked against.")
    else:
        ranks = (
            "Rank 1: no method costs less by a difference that these loops resolve; 2: only methods"
            " of rank 1 do; and so on. "
        )
        resolved = f"A difference of {rate_text(standing.resolution)} is resolved between any two."
        said.append(ranks * whole + resolved)

    # Each sentence on its own lines
    lines = []
    for sentence in (*said, where):
        for line in wrap(sentence):
            lines.append(line)
    return lines


def _count_rivals(rows: pd.DataFrame) -> int:
    """Return how many methods are ranked with each other on the same loops."""
    ranked = rows[(rows.kind < 2) & rows["rank"].notna() & ~rows.partial]
    if len(ranked):
        return int(ranked.kind.value_counts().max())
    return 0


def why_not(scores: Any, rows: pd.DataFrame) -> str:
    """Return why there is no ranking of these rows."""
    if rows.empty:
        n = 0
    else:
        n = int(rows.iloc[0].n)
    if n < RANKED_LOOPS:
        return f"{n} oscillating loops have a clear label, and {RANKED_LOOPS} are needed"
    judged = rows[(rows.kind < 2) & ~rows.method.isin(list(scores.failing))]
    if judged.empty:
        return "no method that could be ranked judged these loops"
    most = judged.loc[judged.applicable.idxmax()]
    return f"no method answers 90 % of the {n} loops; {most.method} answers {most.applicable}"


def ranking(rows: pd.DataFrame, scores: Any, room: int = 10_000) -> list[str]:
    """Return a ranking, within so many lines below its head: constant answers are left out first,
    then the last methods.
    """
    # what fits, one line kept for how many do not; reference rows and the user's own methods stay
    too_many = _count_lines(rows) - room
    if too_many > 0:
        rows = rows.loc[~rows.method.isin(CONSTANTS)]
        too_many = _count_lines(rows) - room
    spare = rows.index[(rows.kind != 2) & ~rows.own][::-1]
    if too_many > 0:
        dropped = spare[: too_many + 1]
    else:
        dropped = spare[:0]
    rows = rows.drop(index=dropped)

    # each group below its name
    head, *body = _format_rows(rows)
    lines = [head]
    for line, group, begins in zip(body, rows.group, _begins_group(rows), strict=True):
        if begins:
            lines.append(f"-- {group}")
        lines.append(line)
    return lines + ([f"... and {len(dropped)} more methods: --full"] if len(dropped) else [])


def _begins_group(rows: pd.DataFrame) -> pd.Series:
    """Return which rows are the first of a group with a name."""
    return rows.group.ne(rows.group.shift(fill_value=""))


def _count_lines(rows: pd.DataFrame) -> int:
    """Return how many lines rows take with the names of their groups."""
    return len(rows) + int(_begins_group(rows).sum())


def _format_rows(rows: pd.DataFrame) -> list[str]:
    """Return a head and one line a row; of too wide a table the intervals of all but the cost are
    left out.
    """
    for intervals in (("cost", "accuracy", "no_decision"), ("cost",)):
        table = _format_rates(rows, _TITLES, intervals=intervals).drop(columns="n")
        table.insert(0, "rank", _rank_texts(rows))
        lines = lines_of(table)
        if max(map(len, lines)) <= LINE_WIDTH:
            break
    return lines


def _rank_texts(rows: pd.DataFrame) -> np.ndarray:
    """Return ranks as texts: - of a method without one, nothing of a reference row."""
    unranked = np.where(rows.kind > 1, "", "-")
    return np.where(rows["rank"].isna(), unranked, rows["rank"].map("{:.0f}".format))


def rate_text(x: float, few: bool = False) -> str:
    """Return a share with two digits; nothing of few loops.

    >>> rate_text(0.5), rate_text(1.0), rate_text(0.5, few=True)
    ('.50', '1.00', '-')
    """
    if few or math.isnan(x):
        return "-"
    text = f"{x:.2f}"
    if x < 0.995:
        return text.replace("0.", ".", 1)
    return text


def interval_text(value: float, lo: float, hi: float, few: bool = False) -> str:
    """Return a share and its interval."""
    if few or math.isnan(value):
        return "-"
    return f"{rate_text(value)} {rate_text(lo)}-{rate_text(hi)}"


def full_text(scores: Any, truth: str = "cycled", where: str = "") -> list[str]:
    """Return every table of a run, the whole ranking first."""
    # the ranking of all loops, then of each kind of process
    lines = headline(scores, truth, whole=True)
    for process in ("self-regulating", "integrating"):
        rows = scores.rows(truth, process=process)
        if len(rows):
            title = (
                f"oscillating {process} loops, truth {truth!r} ({rows.iloc[0].n},"
                f" {rows.iloc[0].positives} positive)"
            )
            lines += ["", title] + (ranking(rows, scores) if rows.iloc[0].n >= LEAST else [])
            lines.append(_describe_resolution(scores, truth, process))

    # what else the scores hold, each below a title
    sections = (
        _still_table(scores, truth),
        _cause_table(scores),
        _over_no_waveform(scores, truth),
        _detail_table(scores, truth),
        _left_out(scores),
        _dead_band(scores),
        _pair_S_and_J(scores),
        (["labels that disagree"] + lines_of(scores.disagreement)),
        wrap(where),
    )
    for section in sections:
        if section:
            lines += [""] + section
    return lines


def _describe_resolution(scores: Any, truth: str, process: str) -> str:
    standing = scores.standing[truth, process, OF_OSCILLATING]
    if math.isnan(standing.resolution):
        return f"There is no ranking: {why_not(scores, scores.rows(truth, process=process))}."
    more = " and ".join(f"{d:g} with {loops_needed(d, standing.spread)} loops" for d in PLANNED)
    return (
        f"These loops resolve costs {rate_text(standing.resolution)} apart; 9 of 10 runs would"
        f" resolve {more}."
    )


def _format_rates(
    rows: pd.DataFrame,
    titles: Mapping[str, str],
    n: str = "applicable",
    intervals: Sequence[str] = (),
) -> pd.DataFrame:
    """Return rates of methods as texts, of few loops none; a method has the mark of its home."""
    # The mark of a method's home
    few = rows[n] < LEAST
    if "home" in rows:
        marks = rows.home.map(HOME_MARKS).fillna("")
    else:
        marks = ""

    # Rates as texts, few loops none
    table = pd.DataFrame({"method": rows.method + marks, "n": rows[n]})
    for name, title in titles.items():
        if name in intervals:
            ends = zip(rows[name], rows[f"{name}_lo"], rows[f"{name}_hi"], few, strict=True)
            table[title] = [interval_text(*shares) for shares in ends]
        else:
            table[title] = [rate_text(x, some) for x, some in zip(rows[name], few, strict=True)]
    return table


def _still_table(scores: Any, truth: str) -> list[str]:
    """Return the second table: false positives and no decision on loops that do not oscillate."""
    rows = scores.rows(truth, population=OF_NOT_OSCILLATING)
    if rows.empty or rows.iloc[0].n < LEAST:
        return []
    title = f"loops that do not oscillate ({rows.iloc[0].n}, {rows.iloc[0].positives} positive)"
    titles = {"false_positives": "false positives", "no_decision": "no decision"}
    return [title] + lines_of(_format_rates(rows[rows.role != ROLE_YARDSTICK], titles))


def _cause_table(scores: Any) -> list[str]:
    """Return false positives by what makes a loop oscillate whose valve does not."""
    rows = _at_home(scores, scores.by_cause)
    if rows.empty:
        return []
    of_each = "; ".join(f"{c} {n}" for c, n in rows.groupby("cause", sort=False).n.max().items())
    table = _format_rates(rows, {"false_positives": "share"}, "n").assign(cause=rows.cause)
    wide = table.pivot(index="method", columns="cause", values="share").fillna("")
    wide = wide.loc[table.method.unique(), rows.cause.unique()].reset_index()
    title = f"false positives by cause, loops that the valve does not make cycle ({of_each})"
    return wrap(title) + lines_of(wide)


def _at_home(scores: Any, rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows of methods that could be ranked, with the home of each; of loops left out alone
    there are others.
    """
    if rows.empty:
        return rows
    homes = dict(zip(scores.table.method, scores.table.home, strict=True))
    return rows[rows.role != ROLE_YARDSTICK].assign(
        home=lambda r: [homes.get(method, "") for method in r.method]
    )


def _over_no_waveform(scores: Any, truth: str) -> list[str]:
    rows = scores.rows(truth)
    rows = rows[(rows.kind < 2) & (rows.applicable >= LEAST)]
    rows = rows[rows.cost_over_no_waveform.notna()]
    if rows.empty:
        return []

    # the difference with its interval, and whether it is resolved
    lo = rows.cost_over_no_waveform_lo
    hi = rows.cost_over_no_waveform_hi
    table = _format_rates(rows, {})
    table["cost over no_waveform"] = rows.cost_over_no_waveform.map("{:+.2f}".format)
    table["95 %"] = lo.map("{:+.2f}".format) + " to " + hi.map("{:+.2f}".format)
    answers = np.select([hi < 0, lo > 0], ["yes", "no"], "cannot tell")
    table[f"less than {NO_WAVEFORM}"] = answers
    return [f"cost less that of {NO_WAVEFORM} on the same oscillating loops"] + lines_of(table)


def _detail_table(scores: Any, truth: str) -> list[str]:
    """Return what the headline leaves out, over all loops."""
    rows = scores.rows(truth, population=ALL)
    if rows.empty:
        return [f"no loop has a clear label against {truth!r}"]
    titles = {
        **{"cost": "cost", "accuracy": "accuracy", "no_decision": "no decision"},
        **{"sensitivity_at_5": "sens. at 5 %", "auc": "AUC"},
        "accuracy_all": "of all",
    }

    # the rank before the rates
    table = _format_rates(rows, titles)
    table.insert(0, "rank", _rank_texts(rows))
    title = f"all loops, truth {truth!r} ({rows.iloc[0].n}, {rows.iloc[0].positives} positive)"
    legend = (
        "sens. at 5 %: sensitivity at 5 % false positives, threshold from other groups; of all:"
        " accuracy, not-applicable counted as wrong"
    )
    return [title] + lines_of(table) + wrap(legend)


def _left_out(scores: Any) -> list[str]:
    rows = _at_home(scores, scores.left_out)
    if len(rows):
        rows = rows[rows.n > 0]
    if rows.empty:
        return []

    # beside the answers which loops they are
    titles = {}
    for name in ("stiction", "no_stiction", "no_decision"):
        titles[name] = name.replace("_", " ")
    table = _format_rates(rows, titles, "n", intervals=("stiction",))
    table.insert(1, "loops", rows.of)
    title = (
        "not in any row above: answers on entrained and unclear loops, and on those a method does"
        " not apply to"
    )
    return [title] + lines_of(table)


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
    # Families with enough loops
    rows = scores.quantification
    rows = rows[rows.n >= LEAST]
    if rows.empty:
        return []

    # the columns of S beside those of J
    names = {}
    for r in scores.table.itertuples():
        names[r.method] = r.method + HOME_MARKS[r.home]
    table = pd.DataFrame({"method": rows.method.replace(names), "family": rows.family})
    table = table.drop_duplicates().set_index(["method", "family"])
    for p in "SJ":
        mine = rows[rows.parameter == p].set_index(["method", "family"]).rename(index=names)
        table[f"n {p}"] = mine.n.astype(str)
        for name, title in (("median_error", "error"), ("coverage", "held"), ("width", "width")):
            table[f"{title} {p}"] = mine[name].map("{:.3f}".format).replace("nan", "-")

    # What the columns mean
    text = (
        "S and J of sticky loops by family of valves: median error and width in shares of the"
        " valve's S; held: share of the intervals that hold the truth, nominally nine in ten; -"
        " where a method states no level."
    )
    return wrap(text) + lines_of(table.astype(object).fillna("-").reset_index())

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
    OF_OSCILLATING,
    SAMPLED,
    loops_of,
)
from simbench.bench.score.ranks import RANKED_LOOPS
from simbench.bench.score.shipped import UNLIKE
from simbench.bench.store.benchmark import FROM_RECORDS, benchmark_text
from simbench.bench.store.manifest import unmatched
from simbench.detectors.report.report import columns

if TYPE_CHECKING:
    import pandas as pd

# of the default output
_LINES = 30
_WIDTH = 100  # characters
# lines that a command prints around the table: what failed, the run's folder
_BESIDES = 2
_RIVALS = 4  # names of methods that the advice holds at most
PLANNED = (0.01, 0.03)  # differences for which the full text tells how many loops they take
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
    rows = scores.rows(truth)
    title = [*_advice(scores, rows), *_title(scores, whole)]
    if rows.empty:
        return [*title, *_sentences(scores, truth, where)]
    title += _label(rows, truth)
    tail = [
        *wrap(_LEGEND.format(undecided=scores.undecided)),
        *_references(rows, whole),
        *_sentences(scores, truth, where, whole),
    ]
    room = 10_000 if whole else _LINES - _BESIDES - len(title) - len(tail) - 2
    return [*title, "", *ranking(rows, scores, room), *tail]


def opening_lines(scores: Any, truth: str) -> list[str]:
    """Return the sentences around a ranking, a paragraph each."""
    rows = scores.rows(truth)
    parts = _advice(scores, rows), _title(scores, True), _label(rows, truth) if len(rows) else []
    around = *parts, _references(rows, True), _sentences(scores, truth, "")
    return [" ".join(filter(None, lines)) for lines in around if lines]


def _label(rows: pd.DataFrame, truth: str) -> list[str]:
    """Return how many loops the ranking is on, and what counts as stiction."""
    first = rows.iloc[0]
    return wrap(
        f"{first.n} loops have a clear label and oscillate; in {first.positives} {_TRUTHS[truth]}"
        f" (truth {truth!r})."
    )


def _advice(scores: Any, rows: pd.DataFrame) -> list[str]:
    """Return on which method to rely for loops like those of a run that was made from records, or
    that none is worth more than no answer; nothing of another run, or of some methods alone.
    """
    source = scores.manifest.get("grid_content", {}).get("source")
    if source != FROM_RECORDS or scores.chosen:
        return []

    # records of a plant seldom have MV: methods that see OP and PV are advised alone
    ranked = rows if rows.empty else rows[(rows.kind == 0) & rows["rank"].notna()]
    if ranked.empty:
        why = why_not(scores, rows)
        return [*wrap(f"Which method to rely on for loops like these is unknown: {why}."), ""]

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
        return [*wrap(f"Rely on {best.method} for such loops: {about}."), ""]
    return [*wrap(f"No method is known to be worth more here than no answer: {about}."), ""]


def _references(rows: pd.DataFrame, whole: bool) -> list[str]:
    """Return what the reference rows are; where a run was stored without what they see, that."""
    if NO_WAVEFORM not in rows.method.tolist():
        return wrap(NO_REFERENCES)
    return wrap(_REFERENCES) if whole else []


def along_lines(rates: pd.DataFrame, axes: Sequence[str], grid: str) -> list[str]:
    """Return how the methods depend on an axis of the grid, a line per value and method."""
    lines = [(axes[0], "method", "n", "accuracy", "sensitivity", "false positives", "no decision")]
    for r in rates.to_dict("records"):
        few = r["n"] < LEAST
        shares = [
            interval_text(r[name], r[f"{name}_lo"], r[f"{name}_hi"], few)
            for name in ("accuracy", "sensitivity", "false_positives")
        ]
        counts = (str(r[axes[0]]), r["method"], str(r["n"]))
        lines.append((*counts, *shares, rate_text(r["no_decision"], few)))
    about = f"grid {grid}, all loops with a label; -: fewer than {LEAST} loops, or no such loop"
    return [*wrap(about), *columns(lines)]


def two_way_lines(
    rates: pd.DataFrame, axes: Sequence[str], grid: str, shares: Sequence[str] = ("accuracy",)
) -> list[str]:
    """Return some shares of each method over two axes, the first down and the second across."""
    down, across = axes
    more = "" if len(shares) > 1 else "; --method ID: sensitivity and false positives of one, too"
    lines = wrap(
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
    return f"({rate_text(share)}) {n}" if n < LEAST else f"{rate_text(share)} {n}"


def _title(scores: Any, whole: bool) -> list[str]:
    """Return what a run is; of the `whole` text also how many loops cycle and were left out."""
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
    if SAMPLED in counts:
        lines += wrap(
            "Rates and costs are of all loops. Their scatter, areas under curves, sensitivity at 5"
            f" % and classifier no_waveform rest on {counts[SAMPLED]} scenarios, drawn at random."
        )
    if not whole:
        return lines
    lines[-1] += "." * (not lines[-1].endswith("."))
    words = (
        scores.disagreement.groupby("cycled").scenarios.sum() if len(scores.disagreement) else {}
    )
    said = ", ".join(
        f"{words.get(word, 0)} {word}" for word in ("yes", "no", "entrained", "unclear")
    )
    lines += wrap(
        f"{counts[OF_OSCILLATING]} loops oscillate. Of all loops, the valve makes the loop cycle:"
        f" {said}."
    )
    if left_out := unmatched(m):
        lines += wrap(
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
        said.append(f"There is no ranking: {why_not(scores, rows)}.")
    elif not scores.chosen and _rivals(rows) < 2:
        said.append("Only one method covers these loops, so it has no rival to be ranked against.")
    else:
        ranks = (
            "Rank 1: no method costs less by a difference that these loops resolve; 2: only methods"
            " of rank 1 do; and so on. "
        )
        resolved = f"A difference of {rate_text(standing.resolution)} is resolved between any two."
        said.append(ranks * whole + resolved)
    return [line for sentence in (*said, where) for line in wrap(sentence)]


def _rivals(rows: pd.DataFrame) -> int:
    """Return how many methods are ranked with each other on the same loops."""
    ranked = rows[(rows.kind < 2) & rows["rank"].notna() & ~rows.partial]
    return int(ranked.kind.value_counts().max()) if len(ranked) else 0


def why_not(scores: Any, rows: pd.DataFrame) -> str:
    """Return why there is no ranking of these rows."""
    n = 0 if rows.empty else int(rows.iloc[0].n)
    if n < RANKED_LOOPS:
        return f"{n} oscillating loops have a clear label, and {RANKED_LOOPS} are needed"
    judged = rows[(rows.kind < 2) & ~rows.method.isin(list(scores.failing))]
    if judged.empty:
        return "no method that could be ranked judged these loops"
    most = judged.loc[judged.applicable.idxmax()]
    return f"no method answers 90 % of the {n} loops; {most.method} answers {most.applicable}"


def ranking(rows: pd.DataFrame, scores: Any, room: int = 10_000) -> list[str]:
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
    for shown in (interval_text, lambda value, lo, hi, few: rate_text(value, few)):
        lines = [HEAD]
        for r in rows:
            few = r.applicable < LEAST
            rank = math.isnan(r.rank)
            lines.append(
                (
                    ("" if r.kind > 1 else "-") if rank else f"{r.rank:.0f}",
                    r.method + HOME_MARKS[r.home],
                    interval_text(r.cost, r.cost_lo, r.cost_hi, few),
                    shown(
                        r.accuracy,
                        r.accuracy_lo,
                        r.accuracy_hi,
                        few,
                    ),
                    rate_text(r.sensitivity, few),
                    rate_text(r.false_positives, few),
                    shown(r.no_decision, r.no_decision_lo, r.no_decision_hi, few),
                )
            )
        text = columns(lines)
        if max(map(len, text)) <= _WIDTH:
            break
    return text


def rate_text(x: float, few: bool = False) -> str:
    """Return a share with two digits."""
    return (
        "-"
        if few or math.isnan(x)
        else f"{x:.2f}".replace("0.", ".", 1)
        if x < 0.995
        else f"{x:.2f}"
    )


def interval_text(value: float, lo: float, hi: float, few: bool = False) -> str:
    """Return a share and its interval."""
    return (
        "-" if few or math.isnan(value) else f"{rate_text(value)} {rate_text(lo)}-{rate_text(hi)}"
    )


def wrap(text: str) -> list[str]:
    """Return a sentence in lines of the width of the tables."""
    return textwrap.wrap(text, _WIDTH)

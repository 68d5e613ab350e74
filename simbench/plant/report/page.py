"""Write the page of a plant's loops, and the same as a table."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from zlib import crc32

import pandas as pd
from markupsafe import Markup

from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import score_units
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, PROBABILITY, STICTION, Verdict
from simbench.files import write_table
from simbench.gap.stiction.conclusion import WORDS
from simbench.html.page import render
from simbench.html.svg import inline_svg
from simbench.plant.episodes import OverTime, marks
from simbench.plant.page import ROOM, SectionTable, section, write
from simbench.plant.report.advice import MEASUREMENT, TUNING, UPSTREAM, VALVE, best
from simbench.plant.report.fleet import Fleet, FleetLoop
from simbench.plant.resumed import resumed
from simbench.plant.trust.pictures import draw_pv_op, draw_trend

_TABLE_ONLY = (  # in the CSV next to the page, and in the part of the page on the loop
    "speaks for",
    "speaks against",
    "OP share",
    "travel a day (%)",
    "reversals a day",
    "in automatic",
    "at a limit",
    "of today's",
    "from",
    "to",
    "S from",
    "S to",
    "answer",
    "reason",
    "best action",
    "PV share",
    "S unit",
    "smallest visible S",
    "root",
    "cycles",
)
_SHARES = (PROBABILITY.replace("_", " "), "confidence", "priority")
_COLUMNS = (
    "S, J: estimated stick band and slip-jump, in % of travel where the span of OP is known,"
    " else in"
    " units of OP.",
    "Confidence: how sure the evidence makes the cause, from 0 to 1. Priority: share of the"
    " variance"
    " of PV that the cause explains, times the confidence; loops that this loop disturbs count"
    " too.",
    "Status: whether an earlier report (--previous) named the same cause. Job: what to work on.",
    "Oscillation: number of the oscillation that several loops share. Sticky cycles: cycles with"
    " stiction, of all cycles in the record.",
)
_FIRST = 12  # loops named per trade
_TRADES = {
    VALVE: "Maintenance, at the valve",
    TUNING: "Control engineer, tuning",
    UPSTREAM: "Operations, upstream",
    MEASUREMENT: "Instruments, measurement or recording",
}
_ALONE = "No two loops oscillate with one period and locked phases at one time."
# what no picture of ours has
_ACTIVE = re.compile(
    r"<\s*(script|foreignobject|iframe|a)\b|\bon\w+\s*=|javascript:", re.IGNORECASE
)
_SIGN = {STICTION: "●", NO_STICTION: "·", NO_DECISION: "?"}


def write_fleet(
    fleet: Fleet,
    path: str | Path,
    labels: dict[str, dict[str, str]] | None = None,
    *,
    jobs: int = 1,
    keep: Path | None = None,
) -> Path:
    """Write a plant's loops as one self-contained page, and a CSV of the same name next to it;
    pictures drawn are in `keep`.
    """
    sticky = [m for m in fleet.members if m.conclusion.verdict == STICTION]
    tiles = [
        (str(len(fleet.members)), "loops judged"),
        (str(len(sticky)), "with stiction claimed"),
        (str(len(fleet.events)), "oscillations shared by several loops"),
        (
            str(sum(m.trust.probability is None for m in fleet.members)),
            "records that cannot be judged",
        ),
    ]
    frame = table(fleet)
    # words that wrap, so that a screen of 1200 px holds every column
    shown = frame.drop(columns=[*fleet.methods, *_TABLE_ONLY]).rename(
        columns=lambda name: name.replace("_", " ")
    )
    of_all = {"sticky cycles": ["" if pd.isna(n) else f"of {n}" for n in frame["cycles"]]}
    parts = [
        section("jobs", "Who must do what", _jobs(fleet), tiles=tiles),
        section(
            "ranking",
            "Where to go first",
            table=SectionTable(shown, ["next"], of_all, shares=_SHARES),
            points=_COLUMNS,
        ),
        section("events", "Oscillations that loops share", fleet.shared() or [_ALONE]),
        section(
            "matrix",
            "Detectors and loops",
            [_legend()],
            table=SectionTable(_matrix(frame, fleet), matrix=True),
        ),
    ]
    if labels:
        pairs = [(m.name, v) for m in fleet.members for v in m.verdicts]
        parts.append(
            section(
                "score",
                "Score against the labels",
                table=SectionTable(pd.DataFrame(score_units(pairs, labels))),
            )
        )
    asked = [(m.name, m.trust.record, m.over_time) for m in fleet.members]
    drawn = resumed(_drawn, asked, jobs=jobs, keep=keep, what="pictures")
    # kept pictures may be of another's folder
    drawn = [
        _drawn(*about) if any(map(_ACTIVE.search, seen)) else seen
        for about, seen in zip(asked, drawn, strict=True)
    ]
    loops = (
        render(ROOM, "loops.html", loops=[_article(rank, m, seen)])
        for rank, (m, seen) in enumerate(zip(fleet.members, drawn, strict=True), 1)
    )
    parts.append({"id": "loops", "title": "Loop by loop", "parts": loops})
    if fleet.refused:
        parts.append(
            section(
                "refused", "Left out", points=[f"{n}: {why}" for n, why in fleet.refused.items()]
            )
        )
    write(path, "A plant's loops", f"{len(fleet.members)} records, the most urgent first", parts)
    table_path = Path(path).with_suffix(".csv")
    write_table(frame, table_path)
    return table_path


def _jobs(fleet: Fleet) -> list[str]:
    """Return a sentence per trade, the most urgent loops first, and the fewest valves to test."""
    lines = []
    for job, who in _TRADES.items():
        mine = [
            f"{m.name} ({m.cause.name}{', ' + m.status if m.status else ''})"
            for m in fleet.members
            if m.advice.job == job
        ]
        if mine:
            lines.append(
                f"{who}: {', '.join(mine[:_FIRST])}{', ...' if len(mine) > _FIRST else ''}."
            )
    if fleet.to_test():
        lines.append(f"Fewest valves to test: {', '.join(fleet.to_test())}.")
    return lines or ["Nobody has anything to do."]


def table(fleet: Fleet) -> pd.DataFrame:
    """Return one row per loop: what the page's ranking shows, and every method's verdict."""
    rows = []
    for rank, m in enumerate(fleet.members, 1):
        seen, when = m.trust.smallest_visible, m.over_time
        row: dict[str, Any] = {
            "rank": rank,
            "loop": m.name,
            PROBABILITY: m.trust.probability,
            "answer": WORDS[m.conclusion.verdict],
            "reason": m.conclusion.reason,
            "S": m.size[0] if m.size else None,
            "J": m.size[1] if m.size else None,
            **dict(zip(("S from", "S to"), _interval(m), strict=True)),
            "S unit": m.trust.record.S_unit,
            "cause": m.cause.name,
            "confidence": m.cause.confidence if m.cause.confidence else None,
            "priority": m.priority,
            "status": m.status,
            "job": m.advice.job,
            "next": m.advice.do,
            **_priced(m),
            "oscillation": m.event,
            "root": m.root,
            "smallest visible S": seen[0] if seen else None,
            "sticky cycles": when.sticky if when.several else None,
            "cycles": when.cycles if when.several else None,
        }
        if any(other.pooled != other.trust.probability for other in fleet.members):
            row["pooled over its loop's records"] = m.pooled
        if any(other.label for other in fleet.members):
            row["label"] = m.label.replace("_", " ")
        rows.append(row | {v.method: _word(v) for v in m.verdicts})
    frame = pd.DataFrame(rows)
    return frame.astype(dict.fromkeys(("oscillation", "sticky cycles", "cycles"), "Int64"))


def _interval(m: FleetLoop) -> tuple[float | None, float | None]:
    """Return the interval of S that the procedure states, as wide as the archive leaves it; None
    where it states none.
    """
    S = next((v.S for v in m.verdicts if v.method == "procedure"), None)
    return S if isinstance(S, tuple) else (S, S)


def _priced(m: FleetLoop) -> dict[str, Any]:
    """Return what a loop costs, what speaks for and against its cause, and what would help most."""
    cost, first = m.cost, best(m.actions)
    return {
        "PV share": cost.pv_share,
        "OP share": cost.op_share,
        "travel a day (%)": cost.travel,
        "reversals a day": cost.reversals,
        "in automatic": cost.automatic,
        "at a limit": cost.saturated,
        "speaks for": "; ".join(m.cause.speaks_for),
        "speaks against": "; ".join(m.cause.against),
        "best action": "" if first is None else first.what,
        "of today's": None if first is None else first.variance,
        "from": None if first is None else first.lo,
        "to": None if first is None else first.hi,
    }


def _word(v: Verdict) -> str:
    return "not applicable" if v.applicable is False else v.verdict.replace("_", " ")


def _why(m: FleetLoop) -> list[str]:
    """Return the causes weighed, what the loop costs, what would help, and what reading its record
    assumed.
    """
    lines = [] if m.causes is None else m.causes.as_lines()
    lines.append(f"Cost: {m.cost.sentence()}.")
    lines += [f"What if: {'; '.join(a.sentence() for a in m.actions)}."] if m.actions else []
    return lines + [f"Assumed: {note}." for note in m.trust.record.notes]


def _legend() -> str:
    words = {STICTION: "stiction", NO_STICTION: "no stiction", NO_DECISION: "no decision"}
    return (
        ", ".join(f"{_SIGN[v]} {word}" for v, word in words.items())
        + ", blank: the method does not apply to this loop."
    )


def _matrix(frame: pd.DataFrame, fleet: Fleet) -> pd.DataFrame:
    signs = {word.replace("_", " "): sign for word, sign in _SIGN.items()} | {"not applicable": ""}
    return pd.concat(
        [frame[["rank", "loop"]], frame[list(fleet.methods)].map(lambda word: signs[word])], axis=1
    )


def _drawn(name: str, record: LoopRecord, when: OverTime) -> tuple[str, str]:
    """Return a loop's trend and its PV against OP; their ids, unique on the page, are the same next
    week.
    """
    suffix = f"{crc32(name.encode()):08x}"
    trend = inline_svg(
        draw_trend(record, marks(when)), f"trend-{suffix}", f"PV, SP and OP of {name} over time"
    )
    return trend, inline_svg(draw_pv_op(record), f"plane-{suffix}", f"PV of {name} against OP")


def _article(rank: int, m: FleetLoop, drawn: tuple[str, str]) -> dict[str, Any]:
    caption = "PV (red), SP (grey), OP (blue)"
    if m.over_time.several:
        caption += f"; {m.over_time.sentence()} (orange: windows with stiction, grey: undecided)"
    verdicts = [f"{v.method}: {_word(v)}" for v in m.verdicts if v.applicable is not False]
    return {
        "rank": rank,
        "name": m.name,
        "sentence": f"{m.conclusion.sentence()} Reason: {m.conclusion.reason}.",
        "job": m.advice.job,
        "do": m.advice.do,
        "why": _why(m),
        "pictures": [
            {"svg": Markup(svg), "caption": c}
            for svg, c in zip(drawn, (caption, "PV against OP"), strict=True)
        ],
        "verdicts": "; ".join(verdicts),
        "power": m.trust.power_line(),
    }

"""The page of a detection: what the methods say together, the record, every method's answer with its reason."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from detectors.record import LoopRecord
from detectors.report import summary
from detectors.report.report import Report
from detectors.verdict import Verdict
from simbench.plant.command import causes_of
from simbench.plant.page import section, write
from simbench.plant.report.advice import BY_CAUSE
from simbench.plant.trust.pictures import draw_pv_op, draw_trend

_SHOWN = 12  # records drawn on one page


def write_page(report: Report, path: str | Path) -> None:
    """Write verdicts as one self-contained HTML page."""
    groups = report.groups()
    said = [f"{name + ': ' if name else ''}{summary.sentence(verdicts)}." for name, verdicts, _ in groups]
    for name, verdicts, record in groups[:_SHOWN]:
        if record is not None:
            said += [f"{name + ': ' if name else ''}{line}" for line in _next(record, verdicts)]
    parts = [section("answer", "The answer", said)]
    for number, (name, verdicts, record) in enumerate(groups[:_SHOWN]):
        if record is not None:
            title = name or record.tag or "The record"
            seen = [(draw_trend(record), "The record: PV (red), SP (grey), OP (blue)"), (draw_pv_op(record), "PV against OP")]
            parts.append(section(f"record-{number}", title, pictures=seen, points=summary.notes_of(verdicts, record)))
    parts.append(section("methods", "Every method", table=_table(report), long=["reason"]))
    if report.refused:
        parts.append(section("refused", "Left out", points=[f"{name}: {why}" for name, why in report.refused.items()]))
    write(path, "Does the valve stick?", f"{len(groups)} record{'s' * (len(groups) != 1)} judged", parts)


def _next(record: LoopRecord, verdicts: list[Verdict]) -> list[str]:
    """Return probability, size, cause and next step of one record, for the first screen."""
    causes, p = causes_of(record)
    S = next((v.S for v in verdicts if v.method == "procedure" and v.S is not None), None)
    size = "not stated" if S is None else f"{summary.level(S)} {record.S_unit}"
    chance = "cannot be said" if p is None else f"{p:.2f}"
    _, step = BY_CAUSE[causes.named.name]
    return [f"Probability of stiction: {chance}. Size S: {size}. Next: {step}.", *(line.strip() for line in causes.as_lines())]


def _table(report: Report) -> pd.DataFrame:
    fits = {True: "yes", False: "no", None: "cannot tell"}
    shared = {name: summary.notes_of(verdicts, record) for name, verdicts, record in report.groups()}
    return pd.DataFrame(
        {
            **({} if name is None else {"record": name}),
            "method": v.method,
            "verdict": summary.VERDICT_WORDS[v.verdict],
            "score": v.score,
            "S, J": "" if v.S is None else f"{summary.level(v.S)}, {summary.level(v.J)} {v.S_unit}",
            "made for this loop": fits[v.applicable],
            "reason": summary.own_reason(v, shared.get(name, ())),
        }
        for name, v in report.verdicts
    )

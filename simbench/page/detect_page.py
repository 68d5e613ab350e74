"""Write the HTML page of `simbench detect`: the conclusion, the record, and the verdict of every
method with its reason.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from simbench.detectors.report import summary
from simbench.detectors.report.report import Report
from simbench.detectors.verdict import PROBABILITY
from simbench.page.document import (
    Commands,
    Part,
    Pictures,
    Points,
    Section,
    Table,
    texts,
    two_digits,
    write,
)
from simbench.page.pictures import draw_pv_op, draw_trend

_SHOWN = 12  # records drawn on one page
_COLUMNS = (
    "Score: each method has its own scale; a larger score makes stiction more likely.",
    "S, J: stick band and slip-jump that the method estimates.",
    "Applicable: whether the publication of the method covers such a loop.",
    "The conclusion above does not count these verdicts. It compares models of the loop with and"
    " without valve friction (method likelihood).",
)


def write_page(report: Report, path: str | Path, command: str = "") -> None:
    """Write conclusions and verdicts as one self-contained HTML page, with the command that made
    it; of a folder the first table has one row per loop.
    """
    # the answer, or the loops by it
    groups = report.groups()
    if report.of_folder:
        parts = [_ranking_section(report)]
    else:
        name, verdicts, _ = groups[0]
        if name in report.conclusions:
            lines = report.conclusions[name].as_lines()
        else:
            lines = []
        answer = lines + [f"Methods: {summary.sentence(verdicts)}."]
        parts = [Section("answer", "The answer", texts(answer))]

    # the first records in pictures
    for number, (name, verdicts, record) in enumerate(groups[:_SHOWN]):
        if record is not None:
            title = name or record.tag or "The record"
            seen = [
                (draw_trend(record), "The record: PV (orange), SP (grey), OP (blue)"),
                (draw_pv_op(record), "PV against OP"),
            ]
            shown: list[Part] = [Pictures(seen)]
            if notes := summary.notes_of(verdicts, record):
                shown.append(Points(notes))
            parts.append(Section(f"record-{number}", title, shown))

    # what each method says, and how to repeat it
    table = Table(_verdict_table(report), two_digits("score"), ["reason"])
    parts.append(Section("methods", "Every method", [table, Points(_COLUMNS)]))
    if command:
        parts.append(Section("reproduce", "How to reproduce", [Commands([command])]))
    write(
        path,
        "Does the valve stick?",
        f"{len(groups)} record{'s' * (len(groups) != 1)} judged",
        parts,
    )


def _ranking_section(report: Report) -> Section:
    # a row a loop, in words
    frame = report.loops()
    frame["conclusion"] = frame["conclusion"].replace(summary.CONCLUDED)
    shown = ["record", "conclusion", PROBABILITY, "cause", "event", "reason", "next"]
    frame = frame[shown].rename(columns=lambda name: name.replace("_", " "))
    table = Table(
        frame, two_digits(PROBABILITY.replace("_", " ")), long=["cause", "reason", "next"]
    )

    # what is not in the table
    says = ["Event: loops with the same number share one oscillation."]
    if len(report.records) > _SHOWN:
        says.append(
            f"The first {_SHOWN} of {len(report.records)} loops are drawn below, those in which"
            " stiction is most probable."
        )
    return Section("loops", "The loops", [table, Points(says)])


def _verdict_table(report: Report) -> pd.DataFrame:
    # what is said of a record once is not said of every method
    shared = {}
    for name, verdicts, record in report.groups():
        shared[name] = summary.notes_of(verdicts, record)

    # a row a verdict
    return pd.DataFrame(
        {
            **({} if name is None else {"record": name}),
            "method": v.method,
            "verdict": summary.VERDICT_WORDS[v.verdict],
            "score": v.score,
            "S, J": "" if v.S is None else f"{summary.level(v.S)}, {summary.level(v.J)} {v.S_unit}",
            "applicable": summary.FITS[v.applicable],
            "reason": summary.own_reason(v, shared.get(name, ())),
        }
        for name, v in report.verdicts
    )

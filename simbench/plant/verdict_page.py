"""The page of a detection: what the methods say together, the record, every method's answer with its reason."""

from __future__ import annotations

from pathlib import Path

from detectors import summary
from detectors.report import Report
from simbench.plant.page import section, write
from simbench.plant.pictures import draw_pv_op, draw_trend

SHOWN = 12  # records drawn on one page


def write_page(report: Report, path: str | Path) -> None:
    """Write verdicts as one self-contained HTML page.

    Parameters
    ----------
    report : Report
        What was judged.
    path : str or Path
        Where to.

    Raises
    ------
    FileError
        When the file cannot be written.
    """
    groups = report.groups()
    said = [f"{name + ': ' if name else ''}{summary.sentence(verdicts)}." for name, verdicts, _ in groups]
    parts = [section("answer", "The answer", said)]
    for number, (name, verdicts, record) in enumerate(groups[:SHOWN]):
        if record is not None:
            title = name or record.tag or "The record"
            seen = [(draw_trend(record), "The record: PV (red), SP (grey), OP (blue)"), (draw_pv_op(record), "PV against OP")]
            notes = summary.notes_of(verdicts, record)
            parts.append(section(f"record-{number}", title, pictures=seen, points=notes))
    frame = report.to_frame()
    keys = ["record", "method", "verdict", "score", "S_lo", "S_hi", "J_lo", "J_hi", "applicable", "reason"]
    fits = frame.applicable.map({True: "yes", False: "no"}).fillna("cannot tell")
    table = frame[[k for k in keys if k in frame]].assign(verdict=frame.verdict.map(summary.WORDS), applicable=fits)
    parts.append(section("methods", "Every method", table=table, long=["reason"]))
    if report.refused:
        parts.append(section("refused", "Left out", points=[f"{name}: {why}" for name, why in report.refused.items()]))
    write(path, "Does the valve stick?", f"{len(groups)} record{'s' * (len(groups) != 1)} judged", parts)

"""The page "chapter against code": published numbers, ours, and why they differ."""

from __future__ import annotations

from results.studies.chapter import confirmation, further, methods, theory
from results.studies.chapter.row import Row, Source

HEAD = """# Chapter against code

Every number and statement that can be checked of M. Jelali, \
Control Performance Management in Industrial Automation (Springer
2013), chapter 11, beside what this code gives, and why they differ. \
Written by `python -m results.studies.chapter --isdb
RECORDS`; do not edit.
"""


def rows(isdb: Source = None) -> list[Row]:
    """Compute all rows.

    `isdb`: ISDB file or folder of real records; without it their rows stay empty.

    In the order of the chapter, its remarks in passing last.
    """
    return [row for part in (theory, methods, confirmation, further) for row in part.rows(isdb)]


def page(table: list[Row]) -> str:
    """Return the page in Markdown."""
    word = {True: "yes", False: "**no**", None: "not tried"}
    yes, no, none = (sum(row.agrees is answer for row in table) for answer in (True, False, None))
    lines = [HEAD, f"{yes} reproduce, {no} do not, {none} could not be tried.", ""]
    lines += [
        "| place | quantity | printed | ours | reproduced | why |",
        "|---|---|---|---|---|---|",
    ]
    for row in table:
        cells = (row.place, row.what, row.printed, row.ours, word[row.agrees], row.why)
        lines.append("| " + " | ".join(str(c).replace("|", "\\|") for c in cells) + " |")
    return "\n".join(lines) + "\n"

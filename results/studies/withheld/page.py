"""The page of a score of diagnoses: their figures, the records on which they differ, effects and
sites, and which effect was named for which.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from results.studies.withheld.others import Scored
from results.studies.withheld.picture import confusion, confusion_figure
from simbench.page.document import Pictures, Section, Table, Text, write

_HOW = (
    "One effect was withheld from the baseline of most records, none from others; some have two, or"
    " a fault that the library of effects does not know. Shares have their 95 % interval; those of"
    " one effect are of medium and strong ones, the tables below have weak ones, too.",
    "Within its group: an effect that the record cannot tell from the true one counts as right.",
    "Sites differ in plants, instruments, noise, loads, archive and controllers; a diagnosis that"
    " was tuned to some of them should be judged by the others.",
)


def write_page(scored: Scored, path: str | Path) -> None:
    """Write the score of diagnoses as one self-contained HTML page."""
    names = list(scored.tables)
    parts = [
        Section("figures", "How often each is right", [Table(scored.figures()), *map(Text, _HOW)])
    ]
    if len(names) > 1:
        parts.append(Section("pairs", "On the same records", [Table(scored.pairs())]))
    drawn: list[tuple[Figure, str]] = [
        (confusion_figure(confusion(table)), f"{name}: true effect (rows), named effect (columns)")
        for name, table in scored.tables.items()
    ]
    parts.append(Section("named", "Which effect is named for which", [Pictures(drawn, wide=True)]))
    parts.append(Section("effects", "By effect", [Table(scored.by("effect"))]))
    if scored.sites.notna().any():
        parts.append(Section("sites", "By site", [Table(scored.by("site"))]))
    records = len(next(iter(scored.tables.values())))
    write(
        path,
        "What does the simulation lack?",
        f"{len(names)} diagnoses of {records} records",
        parts,
    )

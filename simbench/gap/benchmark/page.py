"""The HTML page and the picture of `simbench gap grid`: how far, where, which effect, and what it
costs each detector.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLUE, GREY, label, panels, styled
from simbench.gap.benchmark.result import AUC, GridGap
from simbench.html.document import Pictures, Points, Section, Table, texts, write

_CAPTION = (
    "Grey: the grid as it is; blue: with everything added that helps. Left: by all features, and by"
    " those of one block alone; right: after each addition, with its 95 % interval. Dashed: records"
    " and simulations cannot be told apart."
)


def write_page(gap: GridGap, path: str | Path) -> None:
    """Write the answer as one self-contained HTML page."""
    said = [gap.sentence(), f"The block that tells them apart most plainly: {gap.block}."]
    sections = [
        Section("answer", "The answer", texts(said)),
        Section("picture", "How far, and where", [Pictures([(draw(gap), _CAPTION)], wide=True)]),
        Section("blocks", f"{AUC}, by block", [_table(gap.block_rows())]),
    ]
    if gap.singles:
        title = f"{AUC}, with one effect or nuisance in every loop"
        sections.append(Section("effects", title, [_table(gap.single_rows())]))
    if gap.accuracy:
        title = "Accuracy of each detector on the grid as it is, and with what is added"
        sections.append(Section("detectors", title, [_table(gap.accuracy_rows())]))
    if gap.refused:
        points = Points(f"{name}: {why}" for name, why in gap.refused.items())
        sections.append(Section("refused", "Files that are no records", [points]))
    counted = f"{gap.loops} loops of {gap.grid}, {gap.records} records of {gap.units} units"
    write(path, "Does the grid look like these loops?", counted, sections)


def _table(rows: Sequence[Sequence[str]]) -> Table:
    head, *body = rows
    return Table(pd.DataFrame(body, columns=list(head)))


@styled
def draw(gap: GridGap) -> Figure:
    """Draw the AUC by block, and after each addition."""
    figure, axes = panels(1, 2, 9.0, 3.6)
    left, right = axes[0]
    rows = gap.block_rows()[:0:-1]
    for shift, column, colour in ((0.2, 1, GREY), (-0.2, 2, BLUE)):
        places = [k + shift for k in range(len(rows))]
        left.barh(places, [float(row[column]) for row in rows], 0.38, color=colour)
    left.set_yticks(range(len(rows)), [row[0] for row in rows])
    label(left, AUC, "")
    steps = [gap.before, *gap.together]
    names = ["as it is", *(f"+ {one.chosen[-1][0]}" for one in gap.together)]
    for k, one in enumerate(steps):
        colour = BLUE if k else GREY
        right.plot([one.auc.lo, one.auc.hi], [-k, -k], color=colour)
        right.plot(one.auc.value, -k, "o", color=colour)
    right.set_yticks([-k for k in range(len(steps))], names)
    label(right, AUC, "")
    for axis in (left, right):
        axis.axvline(0.5, color=GREY, linestyle="--", linewidth=0.8)
        axis.set_xlim(0.3, 1.02)
    return figure

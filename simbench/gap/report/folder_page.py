"""Write the HTML page of `simbench gap diagnose FOLDER`: how often each effect was named, how near
the simulations come, and one row per record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLUE, GREY, label, panel, styled
from simbench.gap.report.ranked import words
from simbench.gap.stiction.conclusion import WORDS
from simbench.html.document import Pictures, Points, Section, Table, texts, two_digits, write

_MOST = 60  # records drawn
_SHARES = (
    "probability",
    "probability of stiction",
    "gap as given",
    "gap corrected",
    "parts of the record",
)


def write_folder_page(
    answers: Mapping[str, Mapping[str, Any]],
    sentences: Sequence[str],
    refused: Mapping[str, str],
    path: str | Path,
) -> None:
    """Write the answers about every record as one self-contained HTML page."""
    parts = [Section("answer", "The answer", texts(sentences))]
    if answers:
        caption = "Distance of simulation and record as given (grey) and corrected (blue)"
        parts.append(Section("gaps", "How near", [Pictures([(_draw(answers), caption)])]))
        table = Table(_table(answers), two_digits(*_SHARES), ["reason"])
        parts.append(Section("records", "Every record", [table]))
    if refused:
        points = Points(f"{name}: {why}" for name, why in refused.items())
        parts.append(Section("refused", "Not diagnosed", [points]))
    title = "What do the simulations lack?"
    write(path, title, f"{len(answers)} record{'s' * (len(answers) != 1)} diagnosed", parts)


def _table(answers: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    rows = []
    for name, a in answers.items():
        gap = a["gap"]
        valve = a["conclusion"]
        rows.append(
            {
                "record": name,
                "effect": words(a["effect"]),
                "block": a["block"],
                "probability": a["effects"][0]["probability"],
                "gap as given": gap["before"],
                "gap corrected": gap["after"],
                "parts of the record": gap["plant_floor"],
                "near": "yes" if gap["near"] else "no",
                "valve": WORDS[valve["verdict"]],
                "probability of stiction": valve["probability"],
                "reason": valve["reason"],
            }
        )
    return pd.DataFrame(rows)


@styled
def _draw(answers: Mapping[str, Mapping[str, Any]]) -> Figure:
    names = list(answers)[:_MOST]
    place = -np.arange(len(names))
    sizes = {k: [answers[n]["gap"][k] for n in names] for k in ("before", "after", "plant_floor")}
    figure, axes = panel(7.0, 0.9 + 0.22 * len(names))
    axes.hlines(place, sizes["after"], sizes["before"], color=GREY, linewidth=0.8)
    axes.plot(sizes["before"], place, "o", color=GREY)
    axes.plot(sizes["after"], place, "o", color=BLUE)
    axes.plot(sizes["plant_floor"], place, "|", color="black", markersize=9)
    axes.set_yticks(place, names)
    axes.set_xlim(left=0.0)
    axes.set_ylim(-len(names) + 0.4, 0.6)
    label(axes, "gap (standard deviations); |: how far parts of the record are apart", "")
    return figure

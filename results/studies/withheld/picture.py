"""Draw the confusion matrix of a blind test: true effects against named effects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN
from simbench.page.style import write_picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def confusion(table: pd.DataFrame) -> pd.DataFrame:
    """Return counts: one row per true effect (single effects, none, foreign), one column per name
    given.
    """
    names = [e for b in BLOCKS for e in EFFECTS if EFFECTS[e].block == b] + [NONE, UNKNOWN]
    part = table[table.kind != "two"]
    counts = pd.crosstab(part.effect, part.named.where(part.named.isin(names), "no answer"))
    rows = [n for n in names if n in counts.index]
    columns = [*names, *(["no answer"] if "no answer" in counts else [])]
    return counts.reindex(index=rows, columns=columns, fill_value=0)


def draw(counts: pd.DataFrame, out: Path) -> None:
    """Draw the confusion counts as row shares and save them."""
    write_picture(confusion_figure(counts), out / "confusion.svg")


def confusion_figure(counts: pd.DataFrame) -> Figure:
    """Draw the confusion counts as row shares."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shares = counts.div(counts.sum(axis=1).clip(lower=1), axis=0).to_numpy(float)
    figure = Figure(
        figsize=(0.36 * shares.shape[1] + 3, 0.32 * shares.shape[0] + 2.6), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    edges = [np.arange(k + 1) - 0.5 for k in shares.shape]
    axes.pcolormesh(edges[1], edges[0], shares, cmap="Blues", vmin=0, vmax=1, rasterized=True)
    axes.invert_yaxis()
    for (i, j), n in np.ndenumerate(counts.to_numpy()):
        if n:
            colour = "white" if shares[i, j] > 0.5 else "black"
            axes.text(j, i, str(n), ha="center", va="center", fontsize=7, color=colour)
    axes.set_xticks(range(shares.shape[1]), list(counts.columns), rotation=90, fontsize=8)
    axes.set_yticks(
        range(shares.shape[0]), [f"{e} ({n})" for e, n in counts.sum(axis=1).items()], fontsize=8
    )
    block = [EFFECTS[e].block if e in EFFECTS else e for e in counts.index]
    for i in np.flatnonzero(np.array(block[1:]) != np.array(block[:-1])):
        axes.axhline(i + 0.5, color="0.6", lw=0.8)
    axes.set_xlabel("named")
    axes.set_ylabel("true (records)")
    axes.set_title("What was there, what was named (colour: share of the row)", fontsize=10)
    return figure

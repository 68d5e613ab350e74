"""Score map: how often each detector is right, over dead time and the shape of stiction, plants drawn apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.bench.store import Book
from simbench.figures._style import panels, styled

SOURCE = "own; the grids of Choudhury et al. (2008), Fig. 9, and Jelali (2013), Table 11.3, as axes"
PLANTS = {"self-regulating": ("foptd", "Td_over_T", "Td/T"), "integrating": ("integrating", "Td_over_Ti", "Td/Ti")}
PER_ROW = 2  # methods side by side


def data(run: str | Path) -> pd.DataFrame:
    """Count right answers against `cycled`, with the oscillation front end.

    Parameters
    ----------
    run : str or Path
        Folder of a finished run.

    Returns
    -------
    DataFrame
        method, plant, ratio (Td/T, or Td/Ti of integrating loops), S_over_2J (0 healthy, inf dead-band), n, right (share of
        all), no_decision (share of all).
    """
    book = Book.read(run)
    known = book.truth["cycled"] >= 0
    positive = book.truth["cycled"] == 1
    rows = []
    for plant, (process, axis, _) in PLANTS.items():
        here = known & (book.axes["process"] == process) & ~np.isnan(book.axes[axis]) & ~np.isnan(book.axes["S_over_2J"])
        for ratio in np.unique(book.axes[axis][here]):
            for shape in np.unique(book.axes["S_over_2J"][here]):
                cell = here & (book.axes[axis] == ratio) & (book.axes["S_over_2J"] == shape)
                for i, method in enumerate(book.methods if cell.any() else ()):
                    said = book.verdict[i, cell]
                    right, undecided = float((said == positive[cell]).mean()), float((said == 2).mean())
                    rows.append((method, plant, ratio, shape, int(cell.sum()), right, undecided))
    columns = ["method", "plant", "ratio", "S_over_2J", "n", "right", "no_decision"]
    return pd.DataFrame(rows, columns=columns).sort_values("method", kind="stable", ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one heat map per method and plant."""
    methods, plants = list(data.method.unique()), [p for p in PLANTS if (data.plant == p).any()]
    side = min(PER_ROW, len(methods))
    rows = -(-len(methods) // side)
    figure, axes = panels(rows, side * len(plants), 1.9 * side * len(plants) + 0.9, 1.75 * rows + 0.5)
    image = None
    for k, method in enumerate(methods):
        for j, plant in enumerate(plants):
            place = axes[k // side, (k % side) * len(plants) + j]
            part = data[(data.method == method) & (data.plant == plant)]
            image = _map(place, part, PLANTS[plant][2])
            place.set_title(f"{method}\n{plant}" if j == 0 else f"\n{plant}")
    for place in axes.ravel()[len(methods) * len(plants) :]:
        place.set_axis_off()
    if image is not None:
        bar = figure.colorbar(image, ax=axes, location="right", shrink=0.5, aspect=40)
        bar.set_label("share of right answers (no decision counts as wrong)")
    return figure


def _map(axes: Axes, part: pd.DataFrame, name: str):
    table = part.pivot(index="S_over_2J", columns="ratio", values="right").sort_index()
    image = axes.imshow(table.to_numpy(), vmin=0, vmax=1, cmap="cividis", origin="lower", aspect="auto")
    axes.set_xticks(range(table.shape[1]), [f"{r:g}" for r in table.columns])
    axes.set_yticks(range(table.shape[0]), [{0.0: "none", np.inf: "∞"}.get(s, f"{s:g}") for s in table.index])
    for (i, j), value in np.ndenumerate(table.to_numpy()):
        if not np.isnan(value):
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color="white" if value < 0.55 else "black")
    axes.set_xlabel(name)
    axes.set_ylabel("S/2J")
    axes.spines[:].set_visible(False)
    return image

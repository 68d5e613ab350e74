"""Score map: share of right answers of each detector, over dead time and the shape of stiction,
self-regulating and integrating plants apart.

The row "none" holds healthy valves: a share below 1 there comes from false positives and from no
decision. Below each share: half the width of its 95 % interval, and the number of loops; pale:
fewer than 20 loops. Hatched: the method does not apply to such a process.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.bench.score.answers import answers_of
from simbench.bench.score.names import HOME_MARKS, LEAST
from simbench.bench.score.shipped import read_joined
from simbench.bench.score.tally import counted, long_table, tallied, with_names
from simbench.bench.store.reading import RunArrays
from simbench.figures._score import SHARE_COLOURS, share_map
from simbench.figures._style import label, panel, panels, styled

SOURCE = "own; the grids of Choudhury et al. (2008), Fig. 9, and Jelali (2013), Table 11.3, as axes"
PLANTS = {
    "self-regulating": ("foptd", "Td_over_T", "Td/T"),
    "integrating": ("integrating", "Td_over_Ti", "Td/Ti"),
}
_CELL = ["ratio", "S_over_2J"]
# what is shown of the shares that are counted
_SHARES = {
    "accuracy": "right",
    "no_decision": "no_decision",
    "accuracy_lo": "lo",
    "accuracy_hi": "hi",
}
PER_ROW = 2  # methods side by side
MOST_LEVELS = 8  # levels of an axis; more are put into so many groups of like size


def data(run: str | Path) -> pd.DataFrame:
    """Count right answers against `cycled`, with the oscillation front end.

    Columns: method, plant, ratio (Td/T, or Td/Ti of integrating loops), S_over_2J (0 healthy, inf
    dead-band), n, applicable (of n), right and no_decision (shares of the applicable; NaN where
    there are none), lo, hi (95 % interval of right), home (where the method's constants were
    fitted).
    """
    return cells(read_joined(run))


def cells(book: RunArrays) -> pd.DataFrame:
    """Count right answers of a run in memory; see `data`."""
    label = book.truth["cycled"]
    everyone = [a for a in answers_of(book) if a.method in book.methods]
    answers, parts = long_table(everyone), []
    for plant, (process, axis, _) in PLANTS.items():
        values = [book.axes[axis], book.axes["S_over_2J"]]
        here = (label >= 0) & (book.axes["process"] == process) & ~np.isnan(values).any(axis=0)
        places = np.full((2, here.size), -1)  # in no cell
        texts = []
        for place, x in zip(places, values, strict=True):
            text, place[here] = np.unique(levels(x[here]), return_inverse=True)
            texts.append(text)
        counts = counted(answers, label=label, ratio=places[0], S_over_2J=places[1])
        part = tallied(counts[counts["ratio"] >= 0], [*_CELL, "method"]).reset_index()
        for name, text in zip(_CELL, texts, strict=True):
            part[name] = text[part[name]]
        parts.append(part.assign(plant=plant))
    table = with_names(pd.concat(parts, ignore_index=True), everyone, "home")
    table = table.sort_values("method", kind="stable", ignore_index=True)
    shown = table[["method", "plant", *_CELL, "n", "applicable", *_SHARES, "home"]]
    return shown.rename(columns=_SHARES)


def levels(values: np.ndarray) -> np.ndarray:
    """Return values as they are, or put into few groups, each named by its middle; 0 and inf keep
    their level.
    """
    if np.unique(values).size <= MOST_LEVELS:
        return values
    plain = np.isfinite(values) & (values > 0)
    edges = np.quantile(values[plain], np.linspace(0, 1, MOST_LEVELS - 1))
    middle = np.sqrt(edges[1:] * edges[:-1])
    group = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, middle.size - 1)
    return np.where(plain, [float(f"{m:.2g}") for m in middle[group]], values)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one heat map per method and plant, the method most often right first."""
    counts = data.assign(right=data.right * data.applicable).groupby("method")
    totals = counts[["right", "applicable"]].sum()
    order = (totals.right / totals.applicable).sort_values(ascending=False)
    methods, plants = list(order.index), [p for p in PLANTS if (data.plant == p).any()]
    side = min(PER_ROW, len(methods))
    rows = -(-len(methods) // side)
    figure, axes = panels(
        rows, side * len(plants), 1.9 * side * len(plants) + 0.9, 2.6 * rows + 0.5
    )
    image = None
    for k, method in enumerate(methods):
        for j, plant in enumerate(plants):
            place = axes[k // side, (k % side) * len(plants) + j]
            part = data[(data.method == method) & (data.plant == plant)]
            image = _map(place, part, PLANTS[plant][2])
            place.set_title(
                f"{method}{HOME_MARKS[part.home.iloc[0]]}\n{plant}"
                if j == 0 and len(part)
                else f"\n{plant}"
            )
    for place in axes.ravel()[len(methods) * len(plants) :]:
        place.set_axis_off()
    if image is not None and len(methods) > 1:  # one map's numbers stand in its cells
        bar = figure.colorbar(image, ax=axes, location="right", shrink=0.5, aspect=40)
        bar.set_label(
            "share of right answers (no decision counts as wrong)\n* fitted on this grid, + on"
            f" loops like these\npale: fewer than {LEAST} loops; hatched: does not apply"
        )
    return figure


@styled
def draw_bar() -> Figure:
    """Draw the colours of the maps alone, for pages that show one method a picture."""
    figure, axes = panel(4.0, 0.6)
    levels = np.linspace(0.0, 1.0, SHARE_COLOURS["cmap"].N + 1)
    axes.pcolormesh(levels, [0, 1], levels[np.newaxis, :-1], **SHARE_COLOURS)
    axes.set_yticks([])
    axes.set_xlabel("share of right answers")
    return figure


def _map(axes: Axes, part: pd.DataFrame, name: str):
    shown = part.assign(half=(part["hi"] - part["lo"]) / 2)
    shares, applies, half = (
        shown.pivot(index="S_over_2J", columns="ratio", values=v).sort_index()
        for v in ("right", "applicable", "half")
    )
    texts = shares.map("{:.2f}\n".format) + half.map("±{:.2f}\n".format)
    texts += applies.map("{:.0f}".format)
    image = share_map(axes, *(t.to_numpy() for t in (shares, applies, texts)), size=4.5)
    axes.set_xticks(range(shares.shape[1]), [f"{r:.2g}" for r in shares.columns])
    names = [{0.0: "none", np.inf: "∞"}.get(s, f"{s:.2g}") for s in shares.index]
    axes.set_yticks(range(shares.shape[0]), names)
    label(axes, name, "S/2J")
    return image

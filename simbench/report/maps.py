"""Section of the report: where each detector is right, over dead time and stick band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from simbench.bench.score.names import LEAST
from simbench.page.document import Part, Pictures, Text
from simbench.report.data import RunData

if TYPE_CHECKING:
    import pandas as pd

TITLE = "Maps"
_AXES = {"self-regulating": "Td_over_T", "integrating": "Td_over_Ti"}
_BAND = "S_over_2J"
_SIDE = 3  # maps beside each other
_PALE = 0.35  # opacity of a cell of fewer than `LEAST` loops


def section(run: RunData) -> list[Part]:
    """Draw one map per detector and kind of plant: accuracy over dead time and S/2J."""
    pictures = []
    for process, axis in _AXES.items():
        rates = run.scores.along([_BAND, axis])
        if len(rates):
            caption = f"Accuracy of each detector, {process} loops"
            pictures.append((draw_maps(rates, axis), caption))
    if not pictures:
        return [Text("This grid has no axes of dead time and S/2J.")]
    return [
        Text(
            "Accuracy against whether the loop cycled, over dead time and S/2J; no decision counts"
            " as wrong. A healthy loop stands in the cell of its sticky siblings. Below the share"
            " stands the number of loops; pale cells have fewer than 20."
        ),
        Pictures(pictures, wide=True),
    ]


def draw_maps(rates: pd.DataFrame, axis: str) -> Figure:
    """Draw the accuracy of each method over S/2J (down) and another axis (across), with the number
    of loops in each cell; cells of few loops are pale.
    """
    # the cells of every map, and a figure that has room for them
    methods = list(dict.fromkeys(rates["method"]))
    down, across = (list(dict.fromkeys(rates[name])) for name in (_BAND, axis))
    side = min(_SIDE, len(methods))
    deep = -(-len(methods) // side)
    size = (side * (0.9 + 0.55 * len(across)), deep * (0.9 + 0.42 * len(down)))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(deep, side, squeeze=False).ravel()
    edges = [np.arange(len(values) + 1) - 0.5 for values in (down, across)]
    look = {"vmin": 0.0, "vmax": 1.0, "cmap": colormaps["cividis"].resampled(20)}

    # few colours in a mesh: a page then holds lines, and no embedded image
    image = None
    for axes, method in zip(panels, methods, strict=False):
        mine = rates[rates.method == method].pivot(index=_BAND, columns=axis)
        shares = mine["accuracy"].reindex(index=down, columns=across).to_numpy()
        n = mine["n"].reindex(index=down, columns=across).to_numpy()
        few = n < LEAST
        for shown, alpha in ((few, _PALE), (~few, 1.0)):
            values = np.where(shown, shares, np.nan)
            image = axes.pcolormesh(edges[1], edges[0], values, alpha=alpha, **look)
        for (i, j), share in np.ndenumerate(shares):
            if np.isfinite(share):
                ink = "white" if share < 0.55 and not few[i, j] else "black"
                text = f"{share:.2f}\n{n[i, j]:.0f}"
                axes.text(j, i, text, ha="center", va="center", fontsize=6, color=ink)
        axes.invert_yaxis()
        axes.set_xticks(range(len(across)), across, fontsize=7)
        axes.set_yticks(range(len(down)), down, fontsize=7)
        axes.set(xlabel=axis, ylabel=_BAND, title=method)
    for axes in panels[len(methods) :]:
        axes.set_axis_off()

    # one scale for all of them
    if image is not None:
        bar = figure.colorbar(image, ax=list(panels), shrink=0.6, aspect=40)
        bar.set_label(f"accuracy; below it the number of loops, pale: fewer than {LEAST}")
    return figure

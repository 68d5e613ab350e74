"""What figures draw beside their curves: remarks, arrows with a name, panels by value, tables of
texts.
"""

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.page.style import GREY, RED

_LABEL_BOX = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}


def parts(
    axes: np.ndarray, data: pd.DataFrame, column: str
) -> Iterator[tuple[Axes, Any, pd.DataFrame]]:
    """Yield a panel for each value of a column, in the order of the rows, with the value and its
    rows.
    """
    for place, (value, rows) in zip(axes.flat, data.groupby(column, sort=False)):
        yield place, value, rows


def mosaic(
    layout: list[list[str]], width: float, height: float, **more: Any
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure whose axes lie as their names in `layout` do, `width` x `height` inches; the
    axes by name.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplot_mosaic(layout, **more)


def room(axes: Axes, values: pd.Series, below: float, above: float) -> None:
    """Let a panel reach further than the values drawn, by shares of their range."""
    low = values.min()
    high = values.max()
    axes.set_ylim(low - below * (high - low), high + above * (high - low))


def note(
    axes: Axes, text: str, x: float = 0.02, y: float = 0.98, ha: str = "left", va: str = "top"
) -> None:
    """Write a remark inside a panel, at a place given as shares of its width and height."""
    axes.text(
        x, y, text, transform=axes.transAxes, ha=ha, va=va, fontsize=7.5, bbox=_LABEL_BOX, zorder=5
    )


def arrow(
    axes: Axes, start: Sequence[float], end: Sequence[float], style: str, **look: Any
) -> None:
    """Draw an arrow that reaches both points."""
    look = {"arrowstyle": style, "shrinkA": 0, "shrinkB": 0, **look}
    axes.annotate("", end, start, arrowprops=look)


def text_near(
    axes: Axes, text: str, at: Sequence[float], gap: tuple[float, float], **look: Any
) -> None:
    """Write a text around the place `gap` points away from a point."""
    look = {"ha": "center", "va": "center", **look}
    axes.annotate(text, at, gap, textcoords="offset points", **look)


def span(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    text: str,
    gap: tuple[float, float],
) -> None:
    """Draw a two-headed arrow between two points and its name near the middle, `gap` points
    away.
    """
    arrow(axes, start, end, "<->", linewidth=0.9)
    middle = (np.add(start, end) / 2.0).tolist()
    text_near(axes, text, middle, gap, fontsize=8, bbox=_LABEL_BOX)


def table(
    frame: pd.DataFrame,
    widths: Sequence[int],
    framed: set[tuple[int, int]] = frozenset(),  # type: ignore[assignment]
    foot: str = "",
) -> Figure:
    """Draw a table of texts, its columns so many letters wide, cells in `framed` (row, column) in
    a frame.
    """
    # the texts in lines, and what room they take
    rows = [tuple(map(str, frame.columns)), *frame.astype(str).itertuples(index=False, name=None)]
    texts = [[_wrap_text(t, w) for t, w in zip(row, widths, strict=True)] for row in rows]
    heights = [max(t.count("\n") + 1 for t in row) * 0.155 + 0.11 for row in texts]
    columns = [w * 0.072 + 0.2 for w in widths]
    below = _wrap_text(foot, int(sum(widths) * 1.35))
    if foot:
        bottom = (below.count("\n") + 1) * 0.15 + 0.12
    else:
        bottom = 0.05
    width = sum(columns) + 0.1
    figure = Figure(figsize=(width, sum(heights) + bottom + 0.1))
    high = figure.get_figheight()

    # the table above its foot
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    place = (0.05 / width, (bottom + 0.05) / high, 1.0 - 0.1 / width, sum(heights) / high)
    drawn = axes.table(texts, cellLoc="left", colWidths=columns, bbox=place, edges="B")
    drawn.auto_set_font_size(False)
    for (i, j), cell in drawn.get_celld().items():
        cell.set_height(heights[i] / sum(heights))
        cell.set_text_props(fontweight="normal" if i else "bold", fontsize=8.5)
        cell.set_linewidth(0.8 if i in (0, len(frame)) else 0.0)
        if (i - 1, j) in framed:
            cell.visible_edges = "closed"
            cell.set(edgecolor=RED, linewidth=1.4)
    axes.text(0.12 / width, (bottom - 0.05) / high, below, va="top", fontsize=7.5, color=GREY)
    return figure


def _wrap_text(text: str, width: int) -> str:
    return "\n".join(textwrap.fill(part, max(width, 4)) for part in text.split("\n"))

"""What figures draw beside their curves: remarks, arrows with a name, panels by value, tables of
texts.
"""

import functools
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.page.style import BLACK, GREY, RED

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
    framed: set[tuple[int, int]] = frozenset(),
    foot: str = "",
) -> Figure:  # type: ignore[assignment]
    """Draw a table of texts."""
    head = [_wrap(str(c), w) for c, w in zip(frame.columns, widths)]
    body = [
        [_wrap(str(v), w) for v, w in zip(row, widths)] for row in frame.itertuples(index=False)
    ]
    heights = [max(c.count("\n") + 1 for c in row) * 0.155 + 0.11 for row in [head, *body]]
    below = _wrap(foot, int(sum(widths) * 1.35))
    bottom = (below.count("\n") + 1) * 0.15 + 0.12 if foot else 0.05
    width = sum(widths) * 0.072 + 0.2 * len(widths)
    figure = Figure(figsize=(width, sum(heights) + bottom + 0.1))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(-bottom - 0.05, sum(heights) + 0.05)
    left = np.concatenate([[0.0], np.cumsum([w * 0.072 + 0.2 for w in widths])])
    rule = functools.partial(axes.axhline, color=BLACK, xmin=0.1 / width, xmax=1 - 0.1 / width)
    top = sum(heights)
    for i, (row, height) in enumerate(zip([head, *body], heights)):
        if i < 2:
            rule(top, linewidth=0.8 if i else 1.2)
        for j, text in enumerate(row):
            weight = "normal" if i else "bold"
            axes.text(left[j] + 0.12, top - height / 2, text, va="center", fontweight=weight)
            if (i - 1, j) in framed:
                corner = left[j] + 0.04, top - height + 0.03
                size = left[j + 1] - left[j] - 0.14, height - 0.06
                look = {"fill": False, "edgecolor": RED, "linewidth": 1.4}
                axes.add_patch(matplotlib.patches.Rectangle(corner, *size, **look))
        top -= height
    rule(top, linewidth=1.2)
    axes.text(0.12, top - 0.08, below, va="top", fontsize=7.5, color=GREY)
    return figure


def _wrap(text: str, width: int) -> str:
    return "\n".join(textwrap.fill(part, max(width, 4)) for part in text.split("\n"))

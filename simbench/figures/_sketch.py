"""Sketches: boxes, lines and words at given places, as a table that a figure can draw."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLACK, BLUE, GREY, styled

Point = tuple[float, float]
COLUMNS = ["shape", "part", "x", "y", "text"]


def box(x: float, y: float, text: str) -> list[list]:
    """Return a box around a point, with a text in it."""
    return [["box", f"{text} at {x:g}, {y:g}", x, y, text]]


def arrow(points: Sequence[Point], text: str = "", at: Point | None = None) -> list[list]:
    """Return a line with a head at its last point, and a text beside its first stretch or at a place."""
    return _path("arrow", points, text, at)


def line(points: Sequence[Point], text: str = "", at: Point | None = None) -> list[list]:
    """Return a line without a head."""
    return _path("line", points, text, at)


def words(x: float, y: float, text: str) -> list[list]:
    """Return a text alone."""
    return [["words", f"{text} at {x:g}, {y:g}", x, y, text]]


def sketch(*parts: list[list]) -> pd.DataFrame:
    """Return the table of a sketch: shape, part (which points belong together), x, y, text."""
    return pd.DataFrame([row for part in parts for row in part], columns=COLUMNS)


@styled
def draw_sketch(table: pd.DataFrame) -> Figure:
    """Draw a sketch, its units as long as they are high."""
    wide, high = (float(table[c].max() - table[c].min()) + 1.6 for c in ("x", "y"))
    figure = Figure(figsize=(min(0.95 * wide, 9.0), 0.95 * high * min(1.0, 9.0 / (0.95 * wide))), layout="constrained")
    axes = figure.subplots()
    for (shape, _), part in table.groupby(["shape", "part"], sort=False):
        x, y, text = part.x.to_numpy(), part.y.to_numpy(), str(part.text.iloc[0])
        if shape in ("arrow", "line"):
            axes.plot(x, y, color=BLACK, linewidth=1.1, solid_capstyle="round")
            if shape == "arrow":
                tip = {"arrowstyle": "-|>", "color": BLACK, "linewidth": 1.1}
                axes.annotate("", (x[-1], y[-1]), (x[-2], y[-2]), arrowprops=tip)
        else:
            frame = {"boxstyle": "square,pad=0.5", "facecolor": "#F3F6FA", "edgecolor": BLUE} if shape == "box" else None
            axes.text(x[0], y[0], text, ha="center", va="center", fontsize=8, bbox=frame, color=BLACK if frame else GREY)
    axes.set_aspect("equal")
    axes.margins(0.27, 0.08)
    axes.axis("off")
    return figure


def _path(shape: str, points: Sequence[Point], text: str, at: Point | None) -> list[list]:
    name = f"{shape} {points[0]} {points[-1]}"
    rows = [[shape, name, x, y, ""] for x, y in points]
    if text:
        (x0, y0), (x1, y1) = points[0], points[1]
        x, y = at or ((x0 + x1) / 2, (y0 + y1) / 2 + 0.18)
        rows += words(x, y, text)
    return rows

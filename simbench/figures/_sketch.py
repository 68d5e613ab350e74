"""Draw sketches from a table of boxes, lines and words at given places."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from simbench.figures._marks import arrow as head
from simbench.page.style import BLACK, BLUE, GREY, styled

_Point = tuple[float, float]
_SKETCH_COLUMNS = ["shape", "part", "x", "y", "text"]
_NEAR = 1.6  # units; a line that ends closer than this before a box means it


def box(x: float, y: float, text: str) -> list[list]:
    """Return a box around a point, with a text in it."""
    return [["box", f"{text} at {x:g}, {y:g}", x, y, text]]


def arrow(points: Sequence[_Point], text: str = "", at: _Point | None = None) -> list[list]:
    """Return a line with a head at its last point, and a text next to its first stretch or at a
    place.
    """
    return _path_rows("arrow", points, text, at)


def line(points: Sequence[_Point], text: str = "", at: _Point | None = None) -> list[list]:
    """Return a line without a head."""
    return _path_rows("line", points, text, at)


def words(x: float, y: float, text: str) -> list[list]:
    """Return a text alone."""
    return [["words", f"{text} at {x:g}, {y:g}", x, y, text]]


def sketch(*parts: list[list]) -> pd.DataFrame:
    """Return the table of a sketch: shape, part (which points belong together), x, y, text."""
    return pd.DataFrame([row for part in parts for row in part], columns=_SKETCH_COLUMNS)


@styled
def draw_sketch(table: pd.DataFrame) -> Figure:
    """Draw a sketch, its units as long as they are high; arrows that point at a box reach it."""
    # A page of the sketch's own size
    wide = float(table["x"].max() - table["x"].min()) + 1.6
    high = float(table["y"].max() - table["y"].min()) + 1.6
    inches = min(0.95, 9.0 / wide)  # of one unit
    figure = Figure(figsize=(inches * wide, inches * high))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, wide), ylim=(0, high))
    axes.axis("off")

    # Boxes and words first, so that their frames are known
    parts = [(str(p["shape"].iloc[0]), p) for _, p in table.groupby(["shape", "part"], sort=False)]
    for shape, part in parts:
        if shape in ("box", "words"):
            frame = {"boxstyle": "square,pad=0.5", "facecolor": "#F3F6FA", "edgecolor": BLUE}
            if shape == "box":
                look = {"bbox": frame, "color": BLACK}
            else:
                look = {"color": GREY}
            x, y, text = part[["x", "y", "text"]].iloc[0]
            axes.text(x, y, text, ha="center", va="center", fontsize=8, **look)

    # The frames as drawn
    figure.draw_without_rendering()  # which settles the frames
    seen = [(t.get_bbox_patch(), t) for t in axes.texts]
    boxes = [b.get_window_extent().transformed(axes.transData.inverted()) for b, _ in seen if b]
    taken = [t.get_window_extent().transformed(axes.transData.inverted()) for b, t in seen if not b]

    # Lines and arrows end at the frames
    for shape, part in parts:
        if shape in ("arrow", "line"):
            ends = part[["x", "y"]].to_numpy(dtype=float, copy=True)
            ends[0], ends[-1] = (
                _extend_to_box(ends[1], ends[0], boxes),
                _extend_to_box(ends[-2], ends[-1], boxes),
            )
            if shape == "arrow":
                head(axes, ends[-2], ends[-1], "-|>", color=BLACK, linewidth=1.1)
            axes.plot(*ends.T, color=BLACK, linewidth=1.1, solid_capstyle="butt")
            taken.append(Bbox([ends.min(axis=0), ends.max(axis=0)]))

    # The page closes around everything
    whole = Bbox.union(boxes + taken).padded(0.15)
    axes.set(xlim=whole.intervalx, ylim=whole.intervaly)
    figure.set_size_inches(inches * whole.width, inches * whole.height)
    return figure


def _extend_to_box(start: np.ndarray, end: np.ndarray, boxes: Sequence[Bbox]) -> np.ndarray:
    """Return the end of an upright or level line, drawn on to the edge of the box before it."""
    along = int(abs(end[1] - start[1]) > abs(end[0] - start[0]))
    sign = np.sign(end[along] - start[along])
    near = [b for b in boxes if b.min[1 - along] <= end[1 - along] <= b.max[1 - along]]
    steps = []
    for b in near:
        for edge in (b.min[along], b.max[along]):
            steps.append(sign * (edge - end[along]))
    out = end.copy()
    out[along] += sign * min((step for step in steps if -0.3 < step < _NEAR), default=0.0)
    return out


def _path_rows(shape: str, points: Sequence[_Point], text: str, at: _Point | None) -> list[list]:
    name = f"{shape} {points[0]} {points[-1]}"
    rows = [[shape, name, x, y, ""] for x, y in points]
    if text:
        x0, y0 = points[0]
        x1, y1 = points[1]
        x, y = at or ((x0 + x1) / 2, (y0 + y1) / 2 + 0.18)
        rows += words(x, y, text)
    return rows

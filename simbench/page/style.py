"""The common style of all figures: the colours of Okabe and Ito, sizes for print, and axes with
quantity and unit.
"""

import functools
import textwrap
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.detectors.verdict import VERDICTS
from simbench.files import picture_kind, whole_file

# Okabe and Ito (2008), safe for colour-blind readers
BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
_YELLOW = "#F0E442"
BLUE = "#0072B2"
RED = "#D55E00"
PINK = "#CC79A7"
GREY = "#6E6E6E"
_SERIES = (BLUE, RED, GREEN, ORANGE, SKY, PINK, BLACK, GREY)
_DASHES = ("-", "--", ":")  # of the first eight series, the second, the third
SIGNAL = {"OP": BLUE, "MV": GREEN, "PV": RED, "SP": GREY}
VERDICT = {verdict: verdict.replace("_", " ") for verdict in VERDICTS}
_DPI = 200  # of a picture of pixels, as print asks for at the least
_LABEL_BOX = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}

_RC = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "xtick.major.width": 0.8,
    "ytick.major.width": 0.8,
    "figure.facecolor": "white",
}


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Make a `draw` function use the common look."""

    @functools.wraps(draw)
    def wrapped(*args: Any) -> Figure:
        with matplotlib.rc_context(_RC):
            return draw(*args)

    return wrapped


def write_picture(figure: Figure, path: str | Path, simplified: float | None = None) -> None:
    """Write a figure in the format that the file's name asks for; the same numbers give the same
    bytes.
    """
    kind = picture_kind(path)
    plain = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {"Software": None}}
    rc = {"svg.hashsalt": Path(path).stem} | (
        {"path.simplify_threshold": simplified} if simplified else {}
    )
    with matplotlib.rc_context(rc), whole_file(path, "wb") as f:
        figure.savefig(f, format=kind, dpi=_DPI, metadata=plain[kind])


def panels(
    rows: int, columns: int, width: float, height: float, **more: Any
) -> tuple[Figure, np.ndarray]:
    """Return a figure of `rows` x `columns` axes, `width` x `height` inches; the axes as a 2-D
    array.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **more)


def panel(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure of one panel, `width` x `height` inches, and its axes."""
    figure, axes = panels(1, 1, width, height)
    return figure, axes[0, 0]


def parts(
    axes: np.ndarray, data: pd.DataFrame, column: str
) -> Iterator[tuple[Axes, Any, pd.DataFrame]]:
    """Yield a panel for each value of a column, in the order of the rows, with the value and its
    rows.
    """
    for place, (value, rows) in zip(axes.flat, data.groupby(column, sort=False)):
        yield place, value, rows


def text_near(
    axes: Axes, text: str, at: Sequence[float], gap: tuple[float, float], **look: Any
) -> None:
    """Write a text around the place `gap` points away from a point."""
    look = {"ha": "center", "va": "center", **look}
    axes.annotate(text, at, gap, textcoords="offset points", **look)


def arrow(
    axes: Axes, start: Sequence[float], end: Sequence[float], style: str, **look: Any
) -> None:
    """Draw an arrow that reaches both points."""
    look = {"arrowstyle": style, "shrinkA": 0, "shrinkB": 0, **look}
    axes.annotate("", end, start, arrowprops=look)


def mosaic(
    layout: list[list[str]], width: float, height: float, **more: Any
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure whose axes lie as their names in `layout` do, `width` x `height` inches; the
    axes by name.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplot_mosaic(layout, **more)


def series(k: int) -> tuple[str, str]:
    """Return colour and dashes of the k-th of many lines, which repeat after 24."""
    return _SERIES[k % len(_SERIES)], _DASHES[k // len(_SERIES) % len(_DASHES)]


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes and the panel."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title)


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

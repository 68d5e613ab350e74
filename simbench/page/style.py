"""The common style of all figures: the colours of Okabe and Ito, sizes for print, and axes with
quantity and unit.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
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


def series(k: int) -> tuple[str, str]:
    """Return colour and dashes of the k-th of many lines, which repeat after 24."""
    return _SERIES[k % len(_SERIES)], _DASHES[k // len(_SERIES) % len(_DASHES)]


def label(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes and the panel."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title)

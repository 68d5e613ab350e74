"""Draw PV-OP plots with the fitted ellipse, its 10 % limits and its width along OP."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from simbench.detectors.signal.ellipse import TOLERANCE, Ellipse
from simbench.figures._marks import arrow
from simbench.page.style import BLUE, GREY, ORANGE, RED, label


def ellipse_points(ellipse: Ellipse, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of the ellipse, or of a concentric one of another size."""
    angle = np.linspace(0, 2 * np.pi, 181)
    # d' M d = |L' d|^2 with M = L L', so that L' d runs round a circle
    L = np.linalg.cholesky([[ellipse.A, ellipse.B / 2], [ellipse.B / 2, ellipse.C]])
    dx, dy = np.linalg.solve(L.T, size * np.array([np.cos(angle), np.sin(angle)]))
    return ellipse.x0 + dx, ellipse.y0 + dy


def ellipse_table(op: np.ndarray, pv: np.ndarray, ellipse: Ellipse) -> pd.DataFrame:
    """Return the plotted points and the ellipse with its two limits, in long form."""
    curves = {"data": (op, pv)}
    for name, size in (
        ("ellipse", 1.0),
        ("inner limit", 1.0 - TOLERANCE),
        ("outer limit", 1.0 + TOLERANCE),
    ):
        curves[name] = ellipse_points(ellipse, size)
    frames = [pd.DataFrame({"curve": name, "OP": x, "PV": y}) for name, (x, y) in curves.items()]
    return pd.concat(frames, ignore_index=True).assign(
        **{"fitness (-)": ellipse.fitness(op, pv), "S_apparent": ellipse.apparent_stiction}
    )


def draw_ellipse(
    axes: Axes, data: pd.DataFrame, op_label: str, pv_label: str, title: str = ""
) -> None:
    """Draw the points, the ellipse, its limits and the chord along OP through the centre."""
    # Points, ellipse and limits
    points = data[data.curve == "data"]
    ring = data[data.curve == "ellipse"]
    axes.plot(points["OP"], points["PV"], ".", color=GREY, markersize=2, label="filtered data")
    axes.plot(ring["OP"], ring["PV"], color=RED, linewidth=1.6, label="ellipse")
    for name, caption in (("inner limit", "±10 %"), ("outer limit", None)):
        curve = data[data.curve == name]
        axes.plot(
            curve["OP"], curve["PV"], color=BLUE, linestyle="--", linewidth=0.9, label=caption
        )

    # The chord along OP through the centre
    half = float(data["S_apparent"].iloc[0]) / 2
    x0 = float(ring["OP"].max() + ring["OP"].min()) / 2
    y0 = float(ring["PV"].max() + ring["PV"].min()) / 2
    arrow(axes, (x0 - half, y0), (x0 + half, y0), "<->", color=ORANGE, linewidth=1.6)
    label(axes, op_label, pv_label, title)

"""What the pictures of scores share."""

from __future__ import annotations

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

# few levels: a bar of colours is then drawn as lines, no picture is embedded in a page
SHARE_COLOURS = {"vmin": 0.0, "vmax": 1.0, "cmap": colormaps["cividis"].resampled(20)}


def hatch(axes: Axes, x: float, y: float) -> None:
    """Mark the unit cell around (x, y) as one to which a method does not apply."""
    axes.add_patch(
        Rectangle(
            (x - 0.5, y - 0.5),
            1,
            1,
            facecolor="#E4E4E4",
            edgecolor="#9A9A9A",
            hatch="////",
            linewidth=0.0,
        )
    )

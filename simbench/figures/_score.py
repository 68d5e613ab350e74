"""What the pictures of scores share."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Rectangle

# few levels: a bar of colours is then drawn as lines, no picture is embedded in a page
SHARE_COLOURS = {"vmin": 0.0, "vmax": 1.0, "cmap": colormaps["cividis"].resampled(20)}
_NOT_APPLICABLE = {
    "facecolor": "#E4E4E4",
    "edgecolor": "#9A9A9A",
    "hatch": "////",
    "linewidth": 0.0,
}


def share_map(
    axes: Axes, shares: np.ndarray, applies: np.ndarray, texts: np.ndarray, size: float
) -> QuadMesh:
    """Draw shares as colours with a text in each cell, and hatch the cells to which a method does
    not apply.
    """
    edges = [np.arange(k + 1) - 0.5 for k in shares.shape]
    image = axes.pcolormesh(edges[1], edges[0], shares, **SHARE_COLOURS)
    look = {"ha": "center", "va": "center", "fontsize": size}
    for (i, j), value in np.ndenumerate(shares):
        if not applies[i, j]:
            axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **_NOT_APPLICABLE))
        elif not np.isnan(value):
            axes.text(j, i, texts[i, j], color="white" if value < 0.55 else "#000001", **look)
    axes.spines[:].set_visible(False)
    return image

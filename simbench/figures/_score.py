"""What the pictures of scores share."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.patches import Rectangle

from simbench.bench.score.names import LEAST

# few levels: a bar of colours is then drawn as lines, no picture is embedded in a page
SHARE_COLOURS = {"vmin": 0.0, "vmax": 1.0, "cmap": colormaps["cividis"].resampled(20)}
_PALE = 0.3  # opacity of a cell of few loops
_NOT_APPLICABLE = {
    "facecolor": "#E4E4E4",
    "edgecolor": "#9A9A9A",
    "hatch": "////",
    "linewidth": 0.0,
}


def share_map(
    axes: Axes, shares: np.ndarray, applies: np.ndarray, texts: np.ndarray, size: float
) -> QuadMesh:
    """Draw shares as colours with a text in each cell, pale where loops are few; hatch the cells
    to which a method does not apply.
    """
    few = applies < LEAST
    edges = [np.arange(k + 1) - 0.5 for k in shares.shape]
    image = axes.pcolormesh(edges[1], edges[0], np.where(few, np.nan, shares), **SHARE_COLOURS)
    pale = np.where(few, shares, np.nan)
    axes.pcolormesh(edges[1], edges[0], pale, alpha=_PALE, **SHARE_COLOURS)
    look = {"ha": "center", "va": "center", "fontsize": size}
    for (i, j), value in np.ndenumerate(shares):
        if not applies[i, j]:
            axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **_NOT_APPLICABLE))
        elif not np.isnan(value):
            dark = value < 0.55 and not few[i, j]
            axes.text(j, i, texts[i, j], color="white" if dark else "#000001", **look)
    axes.spines[:].set_visible(False)
    return image

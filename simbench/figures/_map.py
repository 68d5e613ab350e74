"""Draw the map of a grid: predicted accuracy of one method over two axes, outlined where it exceeds
0.9.
"""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from simbench.figures._score import SHARE_COLOURS
from simbench.figures._style import RED, panels, styled

ACCURATE = 0.9  # accuracy above which a region is outlined
_MOST_LABELS = 12  # along an axis


@styled
def draw(
    part: pd.DataFrame, method: str, names: tuple[str, str | None], values: dict[str, list[Any]]
) -> Figure:
    """Draw one method's rows of a map; each field is the mean over the cells that share both
    values.
    """
    x, y = names
    table = part.assign(_all="").pivot_table(
        index=y or "_all", columns=x, values="accuracy", aggfunc="mean"
    )
    rows, columns = (
        [v for v in values.get(y or "", [""]) if v in table.index],
        [v for v in values[x] if v in table.columns],
    )
    shown = table.reindex(index=rows, columns=columns).to_numpy()
    width, height = (float(np.clip(0.4 * n, 2.0, 6.0)) for n in shown.shape[::-1])
    figure, axes = panels(1, 1, width + 2.2, (height if y else 0.6) + 1.4)
    place = axes[0, 0]
    edges = [np.arange(n + 1) - 0.5 for n in shown.shape]
    image = place.pcolormesh(edges[1], edges[0], shown, **SHARE_COLOURS)
    place.add_collection(
        LineCollection(_outline(shown > ACCURATE), colors=RED, linewidths=2.0, capstyle="round")
    )
    for axis, known in ((place.xaxis, columns), (place.yaxis, rows)):
        step = -(-len(known) // _MOST_LABELS) or 1
        axis.set_ticks(range(0, len(known), step), [_label(v) for v in known[::step]])
    if any(len(_label(v)) > 6 for v in columns):
        place.tick_params(axis="x", rotation=90)
    place.set_xlabel(x)
    place.set_ylabel(y or "")
    place.set_title(f"{method}: predicted accuracy\n(outlined: above .9)")
    figure.colorbar(image, ax=axes, label="accuracy, mean over the other axes")
    return figure


def _outline(inside: np.ndarray) -> list[list[tuple[float, float]]]:
    """Return the edges between fields inside and fields outside, as lines."""
    framed = np.pad(inside, 1)
    lines = [
        [(j - 0.5, i - 1.5), (j - 0.5, i - 0.5)]
        for i, j in np.argwhere(framed[:, 1:] != framed[:, :-1])
    ]
    return lines + [
        [(j - 1.5, i - 0.5), (j - 0.5, i - 0.5)] for i, j in np.argwhere(framed[1:] != framed[:-1])
    ]


def _label(value: Any) -> str:
    return (value if isinstance(value, str) else f"{value:.3g}")[:24]

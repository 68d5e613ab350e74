"""Figure 11.10: the three symbols of a time series, increasing (I), steady (S) and decreasing (D),
and where they come from.

A sample is I or D where its difference lies more than one standard deviation from the mean
difference.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._marks import mosaic
from simbench.page.style import BLUE, GREY, RED, label, styled

SOURCE = "Jelali (2013), Fig. 11.10, after Yamashita (2006)"
COLOUR = {"I": RED, "S": GREY, "D": BLUE}
HOLDS = [(0, 30), (25, 30), (45, 70), (75, 70), (90, 40), (115, 40), (130, 80), (150, 80)]  # (s, %)


def data() -> pd.DataFrame:
    """Give a series of ramps and holds its symbols.

    Columns: t (s), x (%), normalised difference (-), symbol of the step that ends in the sample.
    """
    t = np.arange(151.0)
    x = np.interp(t, *zip(*HOLDS))
    d = np.diff(x)
    z = np.concatenate([[np.nan], (d - d.mean()) / d.std()])
    symbol = np.where(z > 1, "I", np.where(z < -1, "D", "S"))
    return pd.DataFrame({"t (s)": t, "x (%)": x, "normalised difference (-)": z, "symbol": symbol})


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the three primitives, and a series with its normalised differences."""
    # The three primitives
    figure, axes = mosaic([["a", "b"], ["a", "c"]], 7.2, 3.9, width_ratios=[1, 2.2])
    for symbol, start, end in (
        ("I", (0.1, 0.55), (0.9, 0.95)),
        ("S", (0.1, 0.5), (0.9, 0.5)),
        ("D", (0.1, 0.45), (0.9, 0.05)),
    ):
        axes["a"].annotate(
            "", end, start, arrowprops={"arrowstyle": "->", "color": COLOUR[symbol], "linewidth": 2}
        )
    for y, text in ((0.62, "increasing (I)"), (0.515, "steady (S)"), (0.33, "decreasing (D)")):
        axes["a"].text(0.98, y, text, ha="right", va="bottom")
    axes["a"].set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[])
    label(axes["a"], "time", "value", "(a) primitives")

    # The series, each sample in the colour of its symbol
    t = data["t (s)"]
    x = data["x (%)"]
    z = data["normalised difference (-)"]
    for symbol, colour in COLOUR.items():
        chosen = data.symbol == symbol
        axes["b"].plot(t[chosen], x[chosen], ".", color=colour, markersize=3.5, label=symbol)
        axes["c"].plot(t[chosen], z[chosen], ".", color=colour, markersize=3.5)
    axes["b"].legend(ncols=3, loc="upper left", markerscale=2.5, handletextpad=0.1)
    axes["b"].set_ylim(25, 95)
    label(axes["b"], "", "signal (%)", "(b) a series and its symbols")

    # The limits of a steady sample
    for limit in (-1, 1):
        axes["c"].axhline(limit, color="black", linewidth=0.8, linestyle="--")
    label(axes["c"], "time (s)", "normalised\ndifference (-)")
    return figure

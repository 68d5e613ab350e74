"""Draw the resolution curve: how much of a valve's corner each detector needs to tell a sticky
loop from its echo.

Over the multiple of the cycle's frequency at which an echo ends: the share of the echoes called
sticky, in the band its 95 % interval; dashed: the share of the sticky siblings. The wider the room
between the two, and the farther right it reaches, the less of the corner the detector needs; its
mean stands behind the name. *: fitted on this grid, +: fitted on loops like these.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score.names import HOME_MARKS
from simbench.figures._style import BLUE, ORANGE, label, panels, styled

_PER_ROW = 4  # detectors side by side


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one panel per detector, the best first."""
    methods = list(dict.fromkeys(data["method"]))
    side = min(_PER_ROW, len(methods))
    rows = -(-len(methods) // side)
    figure, axes = panels(rows, side, 2.1 * side + 0.5, 1.75 * rows + 0.5, sharex=True, sharey=True)
    cuts = sorted(data["cut"].unique())
    for place, (method, of) in zip(axes.ravel(), data.groupby("method", sort=False), strict=False):
        first = of.iloc[0]
        siblings = first["called_siblings_lo"], first["called_siblings_hi"]
        place.axhspan(*siblings, color=ORANGE, alpha=0.2, lw=0)
        place.axhline(first["called_siblings"], color=ORANGE, ls="--", lw=1.0)
        place.fill_between(of["cut"], of["called_lo"], of["called_hi"], color=BLUE, alpha=0.2, lw=0)
        place.plot(of["cut"], of["called"], "o-", color=BLUE, ms=2.5, lw=1.2)
        place.set_xscale("log")
        place.set_xticks(cuts, [f"{cut:g}" for cut in cuts])
        place.minorticks_off()
        place.set_ylim(-0.03, 1.03)
        apart = f"{first['told_apart']:.2f}".replace("-", "\N{MINUS SIGN}")
        place.set_title(f"{method}{HOME_MARKS[first['home']]}  {apart}")
    for place in axes.ravel()[len(methods) :]:
        place.set_axis_off()
    for place in axes[:, 0]:
        label(place, "", "called sticky")
    for k in range(side):
        axes[(len(methods) - 1 - k) // side, k].tick_params(labelbottom=True)
    figure.supxlabel(
        "frequency at which the echo ends (multiple of the cycle's)", fontsize="medium"
    )
    figure.legend(
        handles=[axes[0, 0].lines[1], axes[0, 0].lines[0]],
        labels=["echoes", "sticky loops"],
        loc="outside upper center",
        ncols=2,
        labelcolor=[BLUE, ORANGE],
    )
    return figure

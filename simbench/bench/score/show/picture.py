"""Pictures of scores for notebooks: costs as bars, shares over an axis as lines, accuracy over two
axes as maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.score.names import LEAST, loops_of

if TYPE_CHECKING:
    import pandas as pd

_DPI = 200  # of a picture that is saved as pixels
PANELS = ("accuracy", "sensitivity", "false_positives")
_SIDE = 3  # maps beside each other
# parts of a bar, in the order in which they stand
_ANSWERS = {"right": "tab:blue", "no decision": "0.85", "wrong": "tab:red"}
_PALE = 0.35  # opacity of a cell of fewer than `LEAST` loops


def bars(ranking: pd.DataFrame, **options: Any) -> Any:
    """Draw the cost of every method with its interval, the lowest on top; reference rows and other
    methods without a rank are grey.
    """
    rows = ranking.sort_values("cost", ascending=False, kind="stable").set_index("method")
    look: dict[str, Any] = {
        "xerr": [(rows.cost - rows.cost_lo).to_numpy(), (rows.cost_hi - rows.cost).to_numpy()],
        "xlim": (0, 1),
        "xlabel": "cost (mean loss: an error 1), with its 95 % interval; grey: not ranked",
        "color": ["0.8" if np.isnan(rank) else "tab:blue" for rank in rows["rank"]],
    }
    if "ax" not in options:
        size = options.pop("figsize", (7.0, 0.9 + 0.27 * len(rows)))
        options["ax"] = _figure(1, 1, size)[0, 0]
    return rows["cost"].plot.barh(**{**look, **options})


def sides(rows: pd.DataFrame) -> Any:
    """Draw of each method which share of the sticky loops, and of the others, it is right on, does
    not decide and is wrong on; the best on top, groups apart, with 95 % intervals of what is found
    and of what is falsely called.
    """
    # here, for it takes a third of a second to load
    from matplotlib.figure import Figure

    said = rows["sensitivity"].notna() & rows["false_positives"].notna()
    rows = rows.loc[(rows["kind"] < 2) & said]
    begins = ~rows["group"].eq(rows["group"].shift())
    # each group stands a line apart, under its name
    places = -(np.arange(len(rows)) + (begins & rows["group"].ne("")).cumsum().to_numpy())
    # of files and pages, which no window waits for: pyplot would keep it
    size = 8.0, 1.3 - 0.24 * min(places, default=0)
    whole = Figure(figsize=size, dpi=_DPI, layout="constrained")
    figure = whole.subplots(1, 2, sharey=True, squeeze=False)
    open_ = rows["no_decision_negatives"]
    wrong = rows["false_positives"]
    shares = (
        (rows["sensitivity"], rows["no_decision_positives"], rows["missed"]),
        (1.0 - open_ - wrong, open_, wrong),
    )
    ends = (
        (rows["sensitivity"], rows["sensitivity_lo"], rows["sensitivity_hi"]),
        (1.0 - wrong, 1.0 - rows["false_positives_hi"], 1.0 - rows["false_positives_lo"]),
    )
    titles = "loops that the valve makes cycle", "other loops that oscillate"
    for axes, parts, (at, lo, hi), title in zip(figure[0], shares, ends, titles, strict=True):
        left = np.zeros(len(rows))
        for part, (label, colour) in zip(parts, _ANSWERS.items(), strict=True):
            axes.barh(places, part, 0.72, left=left, color=colour, label=label)
            left = left + part.to_numpy()
        axes.errorbar(at, places, xerr=[at - lo, hi - at], fmt="none", ecolor="black", capsize=2)
        axes.set(xlim=(0.0, 1.0), title=title, xlabel="share of loops")
    figure[0, 0].set(ylim=(min(places, default=0) - 0.7, 0.7))
    figure[0, 0].set_yticks(places, rows["method"])
    for place, name in zip(places[begins], rows["group"][begins], strict=True):
        figure[0, 0].text(0.01, place + 1.0, name, va="center", style="italic", fontsize="small")
    parts = figure[0, 0].get_legend_handles_labels()
    whole.legend(*parts, loc="outside lower center", ncols=3)
    return figure[0, 0]


def lines(rows: pd.DataFrame, axis: str, **options: Any) -> Any:
    """Draw the shares of each method over the values of an axis."""
    values = list(dict.fromkeys(rows[axis]))
    wide = rows.pivot(index=axis, columns="method").loc[values]
    panels = options.pop("ax", None)
    if panels is None:
        panels = _figure(1, len(PANELS), options.pop("figsize", (11.0, 4.0)), sharey=True)[0]
    look = {"marker": "o", "ylim": (-0.02, 1.02), "xlabel": axis, "ylabel": "share of loops"}
    # every panel shows every value, also one at which no loop has a rate
    look |= {"xticks": range(len(values)), "xlim": (-0.3, len(values) - 0.7)}
    look |= {"rot": 20, "colormap": "tab20", "legend": False}
    for axes, name in zip(panels, PANELS, strict=True):
        wide[name].plot(ax=axes, **{**look, "title": name.replace("_", " "), **options})
    # beside the curves, none of which it may hide
    panels[-1].legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), title="method", fontsize="small"
    )
    return panels


def maps(
    rows: pd.DataFrame, by: Sequence[str], of: Sequence[str] = PANELS[:1], **options: Any
) -> Any:
    """Draw some shares of each method over two axes, with the number of loops in each cell; cells
    of few loops are pale.
    """
    first, second = by
    drawn = [(method, name) for method in dict.fromkeys(rows["method"]) for name in of]
    down, across = (list(dict.fromkeys(rows[name])) for name in (first, second))
    side = min(_SIDE, len(drawn))
    deep = -(-len(drawn) // side)
    size = (side * (0.9 + 0.55 * len(across)), deep * (0.9 + 0.42 * len(down)))
    panels = options.pop("ax", None)
    if panels is None:
        panels = _figure(deep, side, options.pop("figsize", size)).ravel()
    image = None
    for axes, (method, name) in zip(panels, drawn, strict=False):
        mine = rows[rows.method == method]
        wide = mine.assign(n=loops_of(mine, name)).pivot(index=first, columns=second)
        shares, n = (wide[x].reindex(index=down, columns=across) for x in (name, "n"))
        few = n.to_numpy() < LEAST
        # few colours in a mesh: a page then holds lines, and no embedded image
        edges = [np.arange(k + 1) - 0.5 for k in shares.shape]
        for shown, alpha in ((few, _PALE), (~few, 1.0)):
            values = np.where(shown, shares, np.nan)
            look = {"vmin": 0.0, "vmax": 1.0, "cmap": _colours(), "alpha": alpha, **options}
            image = axes.pcolormesh(edges[1], edges[0], values, **look)
        axes.invert_yaxis()
        for (i, j), share in np.ndenumerate(shares.to_numpy()):
            if np.isfinite(share):
                ink = "white" if share < 0.55 and not few[i, j] else "black"
                text = f"{share:.2f}\n{n.to_numpy()[i, j]:.0f}"
                axes.text(j, i, text, ha="center", va="center", fontsize=6, color=ink)
        axes.set_xticks(range(len(across)), across, fontsize=7)
        axes.set_yticks(range(len(down)), down, fontsize=7)
        title = method if len(of) == 1 else f"{method}: {name.replace('_', ' ')}"
        axes.set(xlabel=second, ylabel=first, title=title)
    for axes in panels[len(drawn) :]:
        axes.set_axis_off()
    if image is not None:
        bar = panels[0].figure.colorbar(image, ax=list(panels), shrink=0.6, aspect=40)
        what = of[0] if len(of) == 1 else "share"
        bar.set_label(f"{what}; below it the number of loops, pale: fewer than {LEAST}")
    return panels


def _colours() -> Any:
    from matplotlib import colormaps

    return colormaps["cividis"].resampled(20)


def _figure(rows: int, columns: int, size: tuple[float, float], **options: Any) -> Any:
    """Return the axes of a new figure, which leaves room for every name."""
    import matplotlib.pyplot as plt

    look = {"figsize": size, "dpi": _DPI, "layout": "constrained", "squeeze": False, **options}
    return plt.subplots(rows, columns, **look)[1]

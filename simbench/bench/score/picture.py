"""Pictures of a ranking: costs as bars, and what each method is right on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

_DPI = 200  # of a picture that is saved as pixels
# parts of a bar, in the order in which they stand
_ANSWERS = {"right": "tab:blue", "no decision": "0.85", "wrong": "tab:red"}


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
        # here, for it takes a third of a second to load
        import matplotlib.pyplot as plt

        size = options.pop("figsize", (7.0, 0.9 + 0.27 * len(rows)))
        options["ax"] = plt.subplots(figsize=size, dpi=_DPI, layout="constrained")[1]
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

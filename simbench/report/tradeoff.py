"""Section of the report: cost over the weight of no decision, over the share of sticky loops, and
how much of a corner each detector needs.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score import tradeoff
from simbench.bench.score.names import LEAST, ROLE_YARDSTICK
from simbench.figures._style import GREY, label, panels, series, styled
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "What the order rests on"


def section(run: RunData) -> list[Part]:
    """Draw the two costs of every ranked detector, and its resolution where the grid has echoes of
    several cuts.
    """
    rows = run.scores.ranked_methods()
    rows = rows[rows["applicable"] >= LEAST] if len(rows) else rows
    pictures = []
    if len(rows):
        caption = (
            "Cost over the weight of no decision (half of the loops stick) and over prevalence"
        )
        pictures.append((_draw_costs(rows, run.scores.undecided), caption))
    cuts = run.scores.by_axis
    cuts = cuts[(cuts["axis"] == "cut") & (cuts["role"] != ROLE_YARDSTICK)]
    cuts = cuts[cuts["applicable"] >= LEAST]
    if len(cuts):
        caption = "Share of echoes called sticky over the frequency at which they end"
        pictures.append((_draw_cuts(cuts), caption))
    few = Text("Too few loops oscillate for costs over weight and prevalence.")
    says = (
        "No detector is best for everyone: what no decision costs, and how many loops stick, decide"
        " the order. Where a detector lies above the dotted line, never to claim stiction costs"
        " less. An echo that ends high holds nearly all of the valve's corners and moves like a"
        " sticky loop; the lower the frequency at which a detector still calls it sticky, the less"
        " it needs the corner."
    )
    return [Pictures(pictures, wide=True) if pictures else few, Text(says)]


@styled
def _draw_costs(rows: pd.DataFrame, weight: float) -> Figure:
    figure, axes = panels(1, 2, 8.6, 4.0)
    w, p = np.linspace(0.0, 1.0, 21), np.geomspace(0.02, 0.5, 30)
    over_w = np.array([tradeoff.costs(rows, x, tradeoff.EVEN) for x in w])
    over_p = np.array([tradeoff.costs(rows, weight, x) for x in p])
    for i, method in enumerate(rows["method"]):
        colour, line = series(i)
        axes[0, 0].plot(w, over_w[:, i], line, color=colour, linewidth=1.3, label=method)
        axes[0, 1].plot(p, over_p[:, i], line, color=colour, linewidth=1.3)
    axes[0, 1].plot(p, p, color=GREY, linestyle=":", label="always_no")
    axes[0, 1].set_xscale("log")
    axes[0, 1].set_xticks([0.02, 0.05, 0.1, 0.2, 0.5], ["2 %", "5 %", "10 %", "20 %", "50 %"])
    axes[0, 1].minorticks_off()
    label(axes[0, 0], "cost of no decision (an error costs 1)", "cost per loop")
    label(axes[0, 1], "prevalence: share of loops that stick", "cost per loop")
    lines = [axes[0, 1].lines[-1], *axes[0, 0].lines]
    axes[0, 1].legend(handles=lines, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


@styled
def _draw_cuts(cuts: pd.DataFrame) -> Figure:
    figure, axes = panels(1, 1, 7.6, 4.0)
    for i, (method, mine) in enumerate(cuts.groupby("method", sort=False)):
        colour, line = series(i)
        axes[0, 0].plot(
            mine["value"].astype(float), mine["false_positives"], line, color=colour, marker="o",
            markersize=3, linewidth=1.3, label=method,
        )  # fmt: skip
    axes[0, 0].set_xscale("log")
    ticks = sorted(set(cuts["value"].astype(float)))
    axes[0, 0].set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes[0, 0].minorticks_off()
    axes[0, 0].set_ylim(-0.02, 1.02)
    label(axes[0, 0], "echo ends at (multiple of the cycle's frequency)", "called sticky (share)")
    axes[0, 0].legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure

"""Section of the report: cost over the weight of no decision, and over the share of sticky
loops.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score import tradeoff
from simbench.bench.score.names import LEAST
from simbench.figures._style import GREY, label, panels, series, styled
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "What the order rests on"


def section(run: RunData) -> list[Part]:
    """Draw the two costs of every ranked detector."""
    rows = run.scores.ranked_methods()
    rows = rows[rows["applicable"] >= LEAST] if len(rows) else rows
    says = (
        "No detector is best for everyone: what no decision costs, and how many loops stick, decide"
        " the order. Where a detector lies above the dotted line, never to claim stiction costs"
        " less."
    )
    if not len(rows):
        return [Text("Too few loops oscillate for costs over weight and prevalence."), Text(says)]
    caption = "Cost over the weight of no decision (half of the loops stick) and over prevalence"
    drawn = _draw_costs(rows, run.scores.undecided)
    return [Pictures([(drawn, caption)], wide=True), Text(says)]


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

"""Section of the report: ROC curves of the stiction detectors (sensitivity over false-positive
rate).
"""

from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import rankdata

from simbench.bench.statistics import auc
from simbench.page.document import Part, Pictures, Text
from simbench.page.style import GREY, label, panel, series, styled
from simbench.report.data import RunData

TITLE = "ROC"


class _Curve(NamedTuple):
    """One detector: its curve, the area below it in words, and the point its published threshold
    sits on.
    """

    method: str
    area: str
    points: pd.DataFrame
    published: tuple[float, ...]


def section(run: RunData) -> list[Part]:
    """Draw one curve per detector, the largest area first, with the point its published threshold
    sits on.
    """
    ranked = []
    for method in run.book.methods:
        mine = run.of(method).dropna(subset=["score"])
        if run.role(method) == "stiction" and len(set(mine["positive"])) == 2:
            area = auc(mine["score"].to_numpy(dtype=float), mine["positive"].to_numpy())
            point = tuple(
                mine.loc[mine["positive"] == truth, "called"].mean() for truth in (False, True)
            )
            text = f"{area.value:.2f} ({area.lo:.2f}-{area.hi:.2f})"
            ranked.append((area.value, _Curve(method, text, roc_curve(mine), point)))
    curves = [curve for _, curve in sorted(ranked, key=lambda pair: -pair[0])]
    if not curves:
        says = "No curve can be drawn: the run holds cycling or healthy loops only."
        return [Text(says)]
    says = (
        "Every threshold on the score at once, the largest area first; a dot is the published"
        " threshold. Scores are those after the oscillation front end, records without a score"
        " left out. An area of 0.5 is guessing."
    )
    caption = "Areas: " + ", ".join(f"{c.method} {c.area}" for c in curves)
    return [Text(says), Pictures([(_draw(curves), caption)], wide=True)]


def roc_curve(judged: pd.DataFrame) -> pd.DataFrame:
    """Return false positives and sensitivity as the threshold falls through all scores."""
    from sklearn import metrics  # here, for it takes a second to load

    ranks = rankdata(judged["score"].to_numpy(dtype=float))  # the same curve, and finite
    alarms, hits, _ = metrics.roc_curve(
        judged["positive"].to_numpy(), ranks, drop_intermediate=False
    )
    return pd.DataFrame({"false_positives": alarms, "sensitivity": hits})


@styled
def _draw(curves: Sequence[_Curve]) -> Figure:
    figure, axes = panel(7.6, 4.6)
    axes.plot([0, 1], [0, 1], color=GREY, linestyle=":", linewidth=0.9)
    for i, curve in enumerate(curves):
        colour, line = series(i)
        caption = f"{curve.method}  {curve.area}"
        axes.plot(
            curve.points["false_positives"],
            curve.points["sensitivity"],
            line,
            color=colour,
            linewidth=1.4,
            label=caption,
        )
        axes.plot(*curve.published, "o", color=colour, markersize=5)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    label(axes, "false positives (share of healthy)", "sensitivity (share of cycling)")
    axes.legend(
        loc="upper left", bbox_to_anchor=(1.02, 1.0), title="area (95 % interval)", alignment="left"
    )
    return figure

"""Section: ROC curve of each stiction detector against whether the loop cycled."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.bench.statistics import auc
from simbench.figures._style import BLUE, GREY, RED, styled
from simbench.html.svg import inline_svg
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "ROC"


def section(run: RunData) -> Markup:
    """Draw one curve per detector, with the point its published threshold sits on.

    Parameters
    ----------
    run : RunData
        The run.

    Returns
    -------
    markupsafe.Markup
    """
    items = []
    for method in run.book.methods:
        mine = run.of(method).dropna(subset=["score"])
        if run.role(method) != "stiction" or len(set(mine["positive"])) < 2:
            continue
        area = auc(mine["score"].to_numpy(dtype=float), mine["positive"].to_numpy())
        point = tuple(mine.loc[mine["positive"] == truth, "called"].mean() for truth in (False, True))
        says = f"ROC curve of {method}, AUC {area.value:.2f}"
        items.append(
            {"svg": inline_svg(_draw(method, roc_curve(mine), point), f"roc-{method}", says), "caption": f"AUC {area}"}
        )
    return render("roc.html", items=items)


def roc_curve(judged: pd.DataFrame) -> pd.DataFrame:
    """Return false alarms and detections as the threshold falls through all scores.

    Parameters
    ----------
    judged : DataFrame
        Columns score (no NaN) and positive.

    Returns
    -------
    DataFrame
        false_alarms, detections (-), from (0, 0) to (1, 1).

    Examples
    --------
    >>> curve = roc_curve(pd.DataFrame({"score": [3.0, 2.0, 1.0], "positive": [True, False, True]}))
    >>> curve["detections"].tolist()
    [0.0, 0.5, 0.5, 1.0]
    """
    order = np.argsort(-judged["score"].to_numpy(dtype=float), kind="stable")
    score, positive = judged["score"].to_numpy()[order], judged["positive"].to_numpy()[order]
    last = np.append(score[1:] != score[:-1], True)  # equal scores are passed together
    hits, alarms = np.cumsum(positive)[last], np.cumsum(~positive)[last]
    return pd.DataFrame({"false_alarms": np.append(0.0, alarms / alarms[-1]), "detections": np.append(0.0, hits / hits[-1])})


@styled
def _draw(method: str, curve: pd.DataFrame, point: tuple[float, ...]) -> Figure:
    figure = Figure(figsize=(3.2, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=GREY, linestyle=":", linewidth=0.9)
    axes.plot(curve["false_alarms"], curve["detections"], color=BLUE, linewidth=1.6)
    axes.plot(*point, "o", color=RED)
    axes.set(
        xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="false alarms (share of healthy)", ylabel="detections (share of cycling)"
    )
    axes.set_title(method)
    return figure

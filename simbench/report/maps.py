"""Section: where each detector is right, over dead time and stick band."""

from __future__ import annotations

from markupsafe import Markup

from simbench.figures.score_map import cells, draw
from simbench.html.svg import inline_svg
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Maps"


def section(run: RunData) -> Markup:
    """Draw one map per detector: share of right verdicts over the ratio of dead time and S/2J.

    Parameters
    ----------
    run : RunData
        The run.

    Returns
    -------
    markupsafe.Markup
    """
    counted = cells(run.book)
    items = []
    for method in counted["method"].unique():
        says = f"share of right verdicts of {method} over dead time and S/2J"
        picture = inline_svg(draw(counted[counted["method"] == method]), f"map-{method}", says)
        items.append({"svg": picture, "caption": ""})
    return render("maps.html", items=items)

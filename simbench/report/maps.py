"""Section of the report: where each detector is right, over dead time and stick band."""

from markupsafe import Markup

from simbench.figures.score_map import cells, draw, draw_bar
from simbench.html.svg import inline_svg
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Maps"


def section(run: RunData) -> Markup:
    """Draw one map per detector, in the order of the score table: share of right verdicts over dead
    time and S/2J.
    """
    counted = cells(run.book)
    items = []
    there = set(counted["method"])
    for method in (m for m in run.scores.rows()["method"] if m in there):
        caption = f"share of right verdicts of {method} over dead time and S/2J"
        picture = inline_svg(draw(counted[counted["method"] == method]), f"map-{method}", caption)
        items.append({"svg": picture, "caption": ""})
    return render(
        "maps.html",
        items=items,
        bar=inline_svg(draw_bar(), "map-bar", "colours of the maps, from 0 to 1"),
    )

"""Section of the report: all detectors in one picture, healthy and sticky loops apart."""

from markupsafe import Markup

from simbench.figures.score_overview import draw, overview
from simbench.html.svg import inline_svg
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Overview"


def section(run: RunData) -> Markup:
    """Draw the share of right answers of every detector on every kind of loop."""
    data = overview(run.book, run.scores)
    if data.empty:
        return Markup(
            "<p>No loop of this run is known to cycle or to rest, so that no answer is right or"
            " wrong.</p>"
        )
    picture = inline_svg(
        draw(data), "overview", "share of right verdicts by detector and kind of loop"
    )
    return render("overview.html", picture=picture)

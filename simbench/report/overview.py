"""Section of the report: all detectors in one picture, healthy and sticky loops apart."""

from simbench.figures.score_overview import draw, overview
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "Overview"


def section(run: RunData) -> list[Part]:
    """Draw the share of right answers of every detector on every kind of loop."""
    data = overview(run.book, run.scores)
    if data.empty:
        return [
            Text(
                "No loop of this run is known to cycle or to rest, so that no answer is right or"
                " wrong."
            )
        ]
    says = (
        "Best first, each where it applies; the number after a name is its rank, methods that this"
        " run cannot tell apart share one. On healthy valves and sticky ones at rest the right"
        " answer is no stiction, on cycling ones stiction; no decision is neither. Loops are"
        " counted in brackets."
    )
    caption = "Share of right verdicts by detector and kind of loop"
    return [Text(says), Pictures([(draw(data), caption)], wide=True)]

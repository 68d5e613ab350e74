"""Section of the report: where each detector is right, over dead time and stick band."""

from simbench.figures.score_map import cells, draw, draw_bar
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "Maps"


def section(run: RunData) -> list[Part]:
    """Draw one map per detector, in the order of the score table: share of right verdicts over dead
    time and S/2J.
    """
    counted = cells(run.book)
    if counted.empty:
        return [Text("This grid has no axes of dead time and S/2J.")]
    there = set(counted["method"])
    items = [
        (draw(counted[counted["method"] == m]), f"Share of right verdicts of {m}")
        for m in run.scores.rows()["method"]
        if m in there
    ]
    return [
        Text(
            "In the order of the score table. Share of right verdicts against whether the loop"
            " cycled, over dead time and S/2J; no decision counts as wrong. Pale cells have fewer"
            " than 20 loops (the last number in a cell), hatched cells hold loops that the method"
            ' is not made for. The row "none" holds healthy valves: what is missing there is false'
            " positives and no decision together."
        ),
        Pictures([(draw_bar(), "Colours of the maps, from 0 to 1")], wide=True),
        Pictures(items),
    ]

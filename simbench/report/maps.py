"""Section of the report: where each detector is right, over dead time and stick band."""

from simbench.bench.score.show.picture import maps
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "Maps"
_AXES = {"self-regulating": "Td_over_T", "integrating": "Td_over_Ti"}


def section(run: RunData) -> list[Part]:
    """Draw one map per detector and kind of plant: accuracy over dead time and S/2J."""
    pictures = []
    for process, axis in _AXES.items():
        rates = run.scores.along(["S_over_2J", axis])
        if len(rates):
            panels = maps(rates, ["S_over_2J", axis])
            pictures.append((panels[0].figure, f"Accuracy of each detector, {process} loops"))
    if not pictures:
        return [Text("This grid has no axes of dead time and S/2J.")]
    return [
        Text(
            "Accuracy against whether the loop cycled, over dead time and S/2J; no decision counts"
            " as wrong. A healthy loop stands in the cell of its sticky siblings. Below the share"
            " stands the number of loops; pale cells have fewer than 20."
        ),
        Pictures(pictures, wide=True),
    ]

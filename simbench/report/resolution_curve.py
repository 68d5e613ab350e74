"""Section of the report: how much of a valve's corner each detector needs."""

from simbench.figures._resolution_curve import draw
from simbench.html.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "How much of a corner"


def section(run: RunData) -> list[Part]:
    """Draw the resolution curve of every detector; nothing where the grid has no echoes of several
    cuts.
    """
    table = run.scores.resolution_curve()
    if table.empty:
        return []
    says = (
        "An echo moves like a sticky loop without its valve: above a multiple of the cycle's"
        " frequency nothing of the valve's error is left. One that ends high holds nearly all of"
        " the corner, one that ends low is smooth. The wider the room between echoes (blue) and"
        " sticky loops (orange), and the farther right it reaches, the less of the corner a"
        " detector needs; the number is the mean of that room over the cuts. Bands are 95 %"
        " intervals."
    )
    caption = "Share called sticky over the multiple of the cycle's frequency at which echoes end"
    return [Text(says), Pictures([(draw(table), caption)], wide=True)]

"""Section of the report: the cost of all detectors in one picture."""

from simbench.bench.score.show.picture import bars
from simbench.page.document import Part, Pictures, Text
from simbench.report.data import RunData

TITLE = "Overview"


def section(run: RunData) -> list[Part]:
    """Draw the cost of every detector with its interval."""
    ranking = run.scores.ranking()
    if ranking.empty:
        return [
            Text(
                "No loop of this run is known to cycle or to rest, so that no answer is right or"
                " wrong."
            )
        ]
    caption = "Cost of each detector on the loops that oscillate, with its 95 % interval"
    return [Pictures([(bars(ranking).figure, caption)], wide=True)]

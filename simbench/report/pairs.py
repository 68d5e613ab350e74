"""Section of the report: every two detectors on the same scenarios, and the critical difference of
their mean ranks.
"""

import numpy as np

from simbench.figures._critical_difference import draw, ranks_of
from simbench.html.document import Part, Pictures, Table, Text
from simbench.report.data import RunData

TITLE = "Pairs"


def section(run: RunData) -> list[Part]:
    """Draw the mean ranks with their critical difference, and list wins, ties, losses and p of all
    pairs.
    """
    comparison = run.scores.compare()
    parts: list[Part] = []
    if not np.isnan(comparison.critical_difference):
        says = (
            "Mean ranks over the scenarios of the detectors that apply to all of them and need no"
            " MV (critical difference diagram). Bars that overlap are not told apart."
        )
        caption = "Mean rank of each detector, with the critical difference"
        parts += [Text(says), Pictures([(draw(ranks_of(comparison)), caption)], wide=True)]
    names = [
        f"{k} {r.method}" + (f" (failed on {r.failed} of {r.n})" if r.failed else "")
        for k, r in enumerate(comparison.ranking.itertuples(), 1)
    ]
    # a cell stays in one line
    cells = comparison.cells().map(lambda text: text.replace("-", "\N{NON-BREAKING HYPHEN}"))
    table = cells.set_axis(range(1, len(cells) + 1), axis=1)
    table.insert(0, "detector", names)
    says = (
        f"Every two detectors on the {comparison.cases} scenarios with a label, where both apply."
        " Above the diagonal: scenarios on which only the row's detector was right, both or"
        " neither, and only the column's (win-tie-loss). Below it: p of the exact McNemar test,"
        " with Holm's correction for all pairs; * marks pairs that differ."
    )
    return [*parts, Text(says), Table(table)]

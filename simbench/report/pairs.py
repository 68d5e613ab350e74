"""Section of the report: every two detectors on the same scenarios, and the critical difference of
their mean ranks.
"""

import numpy as np
from markupsafe import Markup

from simbench.figures.critical_difference import draw, ranks_of
from simbench.html.svg import inline_svg
from simbench.html.table import sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Pairs"


def section(run: RunData) -> Markup:
    """Draw the mean ranks with their critical difference, and list wins, ties, losses and p of all
    pairs.
    """
    comparison = run.scores.compare()
    picture = None
    if not np.isnan(comparison.critical_difference):
        caption = "mean rank of each detector, with the critical difference"
        picture = inline_svg(draw(ranks_of(comparison)), "critical-difference", caption)
    names = [
        f"{k} {r.method}" + (f" (failed on {r.failed} of {r.n})" if r.failed else "")
        for k, r in enumerate(comparison.ranking.itertuples(), 1)
    ]
    # a cell stays in one line
    cells = comparison.cells().map(lambda text: text.replace("-", "\N{NON-BREAKING HYPHEN}"))
    table = cells.set_axis(range(1, len(cells) + 1), axis=1)
    table.insert(0, "detector", names)
    return render("pairs.html", picture=picture, table=sortable(table), cases=comparison.cases)

"""Describe a diagnosis that used tests: the probabilities before, the tests that were run, and what
they changed.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.figures._style import BLACK, GREY, label, panels, styled
from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.report.parts import captioned, render
from simbench.gap.report.pictures import PHONE_WIDTH
from simbench.gap.report.result import LEAST_SHOWN, GapReport, words
from simbench.html.table import sortable


def story(report: GapReport, before: GapReport, tests: Sequence[RecordedTest]) -> Markup:
    """Return what was believed without the tests, what was asked and why, and what it changed; the
    records drawn.
    """
    chances = [{r.effect: r.probability for r in one.ranking} for one in (before, report)]
    shown = [e for e in chances[1] if max(c.get(e, 0.0) for c in chances) >= LEAST_SHOWN]
    frame = pd.DataFrame(
        {
            "explanation": [words(e) for e in shown],
            "without the tests": [chances[0].get(e, 0.0) for e in shown],
            "with them": [chances[1][e] for e in shown],
        }
    )
    asked = before.next_test
    shown_of_test = "PV with its set point, and OP; the operator's part is shaded"
    items = captioned(
        (_draw(test), f"test-{i}", f"{test.name}: {shown_of_test}") for i, test in enumerate(tests)
    )
    return render(
        "story.html",
        believed=before.sentence(),
        asked="" if asked is None else asked["says"],
        run=[f"{t.name}{f' ({t.id})' if t.id else ''}" for t in tests],
        refused=[n for n in report.notes if n.startswith("test:")],
        now=report.sentence(),
        table=sortable(frame, dict.fromkeys(("without the tests", "with them"), "{:.3f}".format)),
        items=items,
    )


@styled
def _draw(test: RecordedTest) -> Figure:
    r = test.record
    figure, grid = panels(2, 1, PHONE_WIDTH, 2.8, sharex=True)
    for axes, name, x in ((grid[0, 0], "PV", r.pv), (grid[1, 0], "OP (%)", r.op)):
        axes.plot(r.t, x, color=BLACK, linewidth=0.9)
        label(axes, "", name, "")
        low, high = axes.get_ylim()
        axes.fill_between(r.t, low, high, where=test.manual, color=GREY, alpha=0.25, linewidth=0)
        axes.set_ylim(low, high)
    if r.sp is not None:
        grid[0, 0].plot(r.t, r.sp, color=GREY, linestyle=":", linewidth=1.0)
    grid[1, 0].set_xlabel("time (s)")
    return figure

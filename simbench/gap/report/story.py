"""Describe a diagnosis that used tests: the probabilities before, the tests that were run, and what
they changed.
"""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.report.pictures import draw_shaded
from simbench.gap.report.ranked import LEAST_SHOWN, words
from simbench.gap.report.result import GapReport
from simbench.html.document import Part, Pictures, Points, Table, Text


def story(report: GapReport, before: GapReport, tests: Sequence[RecordedTest]) -> list[Part]:
    """Return what was believed without the tests, what was asked and why, and what it changed; the
    records drawn.
    """
    columns = ("without the tests", "with them")
    chances = pd.DataFrame(
        {
            name: {r.effect: r.probability for r in one.ranking}
            for name, one in zip(columns, (before, report))
        }
    ).fillna(0.0)
    shown = chances[chances.max(axis=1) >= LEAST_SHOWN].sort_values("with them", ascending=False)
    shown.insert(0, "explanation", shown.index.map(words))
    asked = before.next_test
    shown_of_test = "PV with its set point, and OP; the operator's part is shaded"
    drawn = [
        (draw_shaded(test.record, test.manual), f"{test.name}: {shown_of_test}") for test in tests
    ]
    refused = [n for n in report.notes if n.startswith("test:")]
    run = [f"{t.name}{f' ({t.id})' if t.id else ''}" for t in tests]
    return [
        Text(f"Believed from the record alone: {before.sentence()}"),
        *([] if asked is None else [Text(f"Asked for: {asked['says']}.")]),
        Text(f"Run: {', '.join(run)}."),
        *([Points(refused)] if refused else []),
        Text(f"With it: {report.sentence()}"),
        Table(shown, dict.fromkeys(columns, "{:.3f}".format)),
        Pictures(drawn),
    ]

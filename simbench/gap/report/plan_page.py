"""Write the HTML page of `gap plan`: which test to run next, and what each would tell and cost."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from simbench.gap.plan.expected import PlannedTests
from simbench.gap.report.parts import render, write
from simbench.gap.report.result import GapReport, words
from simbench.html.table import sortable


def write_plan_page(plan: PlannedTests, report: GapReport, path: str | Path) -> None:
    """Write a plan as one self-contained HTML page."""
    frame = pd.DataFrame(
        {
            "test": [x.trial.says for x in plan.tests],
            "right after it": [x.p_right for x in plan.tests],
            "information": [x.information for x in plan.tests],
            "minutes": [x.trial.minutes for x in plan.tests],
            "PV excursion": [x.pv_excursion for x in plan.tests],
            "variance of PV": [x.pv_variance for x in plan.tests],
            "travel of OP (%)": [x.trial.op_travel for x in plan.tests],
        }
    )
    body = render(
        "plan.html",
        believed=report.sentence(),
        sentence=plan.sentence(),
        explanations=[(words(e), float(p)) for e, p in zip(plan.effects, plan.probability)],
        tests=sortable(frame) if len(frame) else None,
        left_out=plan.left_out,
    )
    tag = report.behind.found.situation.record.tag
    title = f"Which test next: {tag or 'record'}"
    write(path, title, "Sim-to-real gap of one control loop", [("plan", "The plan", body)])

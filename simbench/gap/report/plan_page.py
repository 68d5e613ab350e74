"""Write the HTML page of `gap plan`: which tests to run next, how long each lasts, and how far it
moves PV.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from simbench.gap.plan.order import PlannedTests
from simbench.gap.report.parts import render, write
from simbench.gap.report.result import GapReport
from simbench.html.table import sortable


def write_plan_page(plan: PlannedTests, report: GapReport, path: str | Path) -> None:
    """Write a plan as one self-contained HTML page."""
    frame = pd.DataFrame(
        {
            "order": range(1, len(plan.tests) + 1),
            "test": [f"{x.id}: {x.says}" for x in plan.tests],
            "minutes": [x.minutes for x in plan.tests],
            "PV moves by (PV units)": [x.pv_excursion for x in plan.tests],
            "OP moves by (%)": [x.op_travel for x in plan.tests],
        }
    )
    body = render(
        "plan.html",
        answer=report.sentence(),
        sentence=plan.sentence(),
        tests=sortable(frame) if len(frame) else None,
        left_out=plan.left_out,
    )
    tag = report.behind.found.situation.record.tag
    title = f"Which test next: {tag or 'record'}"
    write(path, title, "Sim-to-real gap of one control loop", [("plan", "The plan", body)])

"""Write the HTML page of `gap plan`: which tests to run next, how long each lasts, and how far it
moves PV.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from simbench.gap.planning.order import PlannedTests
from simbench.gap.report.result import GapReport
from simbench.html.document import Part, Points, Section, Table, Text, write


def write_plan_page(plan: PlannedTests, report: GapReport, path: str | Path) -> None:
    """Write a plan as one self-contained HTML page."""
    frame = pd.DataFrame(
        {
            "order": range(1, len(plan.tests) + 1),
            "test": [f"{x.id}: {x.says}" for x in plan.tests],
            "minutes": [x.minutes for x in plan.tests],
            "PV moves by (PV units)": [x.pv_excursion for x in plan.tests],
            f"OP moves by ({plan.op_unit})": [x.op_travel for x in plan.tests],
        }
    )
    parts: list[Part] = [
        Text(f"The diagnosis so far: {report.sentence()}"),
        Text(plan.sentence(), "strong"),
    ]
    if len(frame):
        parts += [
            Text(
                "The tests that are left, in the order in which they are recommended. Each was"
                " simulated on the loops of the likeliest explanations, to keep PV and OP within"
                " the limits."
            ),
            Table(frame),
        ]
    if plan.left_out:
        parts.append(Points(f"left out: {why}" for why in plan.left_out))
    tag = report.behind.found.situation.record.tag
    title = f"Which test next: {tag or 'record'}"
    section = Section("plan", "The plan", parts)
    write(path, title, "Sim-to-real gap of one control loop", [section])

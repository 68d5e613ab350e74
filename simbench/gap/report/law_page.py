"""Write the HTML page of `gap discover`: where the record differs, the empirical model, and the
simulation with it.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from markupsafe import Markup

from detectors.record import LoopRecord
from simbench.gap.discover.discovery import Discovery
from simbench.gap.report import law_pictures
from simbench.gap.report.parts import captioned, compared, render, write
from simbench.gap.report.traces import end_of
from simbench.html.table import sortable
from simbench.loop.laws import LAW_FORMS


def write_law_page(discovery: Discovery, path: str | Path) -> None:
    """Write a discovery as one self-contained HTML page."""
    sections = [("law", "What it looks like", law_section(discovery))]
    if discovery.law is not None:
        sections.append(("look", "Record and simulation", _look(discovery)))
    tag = discovery.situation.record.tag
    title = f"{tag or 'Record'} beside its simulation"
    write(path, title, "A law for what has no name", sections)


def law_section(discovery: Discovery) -> Markup:
    """Return the law as on the terminal, where it acts, its curve and its numbers; or why there is
    none.
    """
    law, lines = discovery.law, discovery.as_text().splitlines()
    if law is None:
        return render("law.html", lines=lines, items=[], table=None)
    rules = LAW_FORMS[law.form].numbers
    rows = [
        {
            "number": name,
            "value": f"{value:.4g}",
            "unit": rules[name].unit,
            "interval": (
                "{:.3g} to {:.3g}".format(*law.intervals[name]) if name in law.intervals else ""
            ),
            "what it is": rules[name].says,
        }
        for name, value in law.numbers.items()
    ]
    drawn = [(law_pictures.draw_windows(discovery), "windows", "Where it acts, shaded")]
    if law_pictures.law_curve(discovery) is not None:
        says = f"The law: {LAW_FORMS[law.form].says}"
        drawn.insert(0, (law_pictures.draw_law(discovery), "law", says))
    table = sortable(pd.DataFrame(rows))
    return render("law.html", lines=lines, items=captioned(drawn), table=table)


def _look(discovery: Discovery) -> Markup:
    s = discovery.situation
    Ts = s.record.Ts
    record = LoopRecord(s.op, s.record.pv, Ts, s.sp)
    runs = {name: LoopRecord(op, pv, Ts, s.sp) for name, (op, pv) in discovery.runs.items()}
    items = captioned(compared(record, runs, *end_of(s)))
    return render("look.html", items=items, added="the law", absent=False, given=s.trusted)

"""Write the HTML page of `gap discover`: where the record differs, the empirical model, and the
simulation with it.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from markupsafe import Markup

from simbench.gap.discover.discovery import Discovery
from simbench.gap.report.law_pictures import draw_law, law_curve
from simbench.gap.report.parts import captioned, look, render, write
from simbench.gap.report.pictures import draw_shaded
from simbench.gap.report.traces import RECORD, recorded
from simbench.html.table import sortable
from simbench.loop.laws import LAW_FORMS


def write_law_page(discovery: Discovery, path: str | Path) -> None:
    """Write a discovery as one self-contained HTML page."""
    s, seen = discovery.situation, Markup()
    if discovery.law is not None:
        seen = look({RECORD: recorded(s), **discovery.runs}, s)
    sections = [
        ("law", "What it looks like", law_section(discovery)),
        ("look", "Record and simulation", seen),
    ]
    title = f"{s.record.tag or 'Record'} beside its simulation"
    write(path, title, "A law for what has no name", sections)


def law_section(discovery: Discovery) -> Markup:
    """Return the law as on the terminal, where it acts, its curve and its numbers; or why there is
    none.
    """
    law, lines = discovery.law, discovery.as_text().splitlines()
    if law is None:
        return render("law.html", lines=lines, items=[], table=None)
    form, rows = LAW_FORMS[law.form], []
    for name, value in law.numbers.items():
        ends = "{:.3g} to {:.3g}".format(*law.intervals[name]) if name in law.intervals else ""
        rule = form.numbers[name]
        rows.append((name, f"{value:.4g}", rule.unit, ends, rule.says))
    drawn = []
    if law_curve(discovery, law.numbers) is not None:
        drawn.append((draw_law(discovery), "law", f"The law: {form.says}"))
    shaded = draw_shaded(recorded(discovery.situation), discovery.on)
    drawn.append((shaded, "windows", "Where it acts, shaded"))
    table = pd.DataFrame(rows, columns=["number", "value", "unit", "interval", "what it is"])
    return render("law.html", lines=lines, items=captioned(drawn), table=sortable(table))

"""The page of a trust: the answer, what this record could have shown, whom to believe, what would
help.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from detectors.report import summary
from simbench.plant.episodes import marks
from simbench.plant.page import SectionTable, section, write
from simbench.plant.trust.pictures import draw_power, draw_pv_op, draw_trend
from simbench.plant.trust.result import Trust

_SHOWN = 3  # detectors drawn with the best reading


def write_page(trust: Trust, path: str | Path) -> None:
    """Write a trust as one self-contained HTML page."""
    record = trust.record
    answer = trust.conclusion.as_lines()
    if trust.best is not None:
        answer.append(f"{trust.power_line()[0].upper()}{trust.power_line()[1:]}.")
    tiles = []
    if trust.probability is not None:
        tiles.append(
            (f"{trust.probability:.2f}", "probability of stiction, even odds before looking")
        )
        tiles.append((f"{len(trust.twins)}", "twins of this loop simulated and judged"))
    if trust.smallest_visible is not None:
        tiles.append(
            (
                f"{trust.smallest_visible[0]:.2g}",
                f"smallest S ({record.S_unit}) that shows in 4 of 5 such records",
            )
        )
    parts = [section("answer", "The answer", answer, tiles=tiles)]
    when = trust.over_time
    shaded = (
        ""
        if when is None or not when.several
        else f"; {when.sentence()} (orange: stiction, grey: undecided)"
    )
    trend = draw_trend(record, [] if when is None else marks(when))
    seen = [
        (trend, f"PV (red), SP (grey), OP (blue){shaded}"),
        (draw_pv_op(record), "PV against OP"),
    ]
    parts.append(section("record", "The record", pictures=seen))
    if trust.power:
        best = [m for m in trust.methods if m.verdict.applicable is not False][:_SHOWN]
        curves = {"as best read": trust.power} | {m.verdict.method: m.power for m in best}
        caption = (
            "Share of twins called stiction over S; the band is the 95 % interval of the method"
            " most often right on the twins, as best read, the others by their published rules, the"
            " dashed line 0.8"
        )
        ratios = sorted({round(c.J / c.S, 6) for c in trust.power})
        pictures = [
            (draw_power(curves, ratio, record.S_unit), f"{caption}; J = {ratio:.3g} S")
            for ratio in ratios
        ]
        parts.append(section("power", "What this record could have shown", pictures=pictures))
    parts.append(
        section(
            "methods",
            "Which method to trust on this loop",
            table=SectionTable(_table(trust), ["reason"]),
        )
    )
    points = [*(r.sentence() for r in trust.helps), *trust.notes]
    # they include what reading the record assumed
    points += summary.notes_of([m.verdict for m in trust.methods], record)
    if points:
        parts.append(section("next", "What would help, and what to know", points=points))
    write(
        path,
        f"Stiction in {record.tag or 'this loop'}: what can be believed",
        "Detectors on twins of one loop",
        parts,
    )


def _table(trust: Trust) -> pd.DataFrame:
    shared = summary.notes_of([m.verdict for m in trust.methods], trust.record)
    return pd.DataFrame(
        {
            "method": m.verdict.method,
            "verdict here": (
                "not made for it"
                if m.verdict.applicable is False
                else m.verdict.verdict.replace("_", " ")
            ),
            "right on twins": m.rule.right,
            "false alarms": m.false_alarms,
            "sensitivity": sum(c.share for c in m.power) / len(m.power) if m.power else None,
            "likelihood ratio": m.likelihood_ratio,
            "read by": "published rule" if m.rule.cut is None else f"score above {m.rule.cut:.3g}",
            "reason": summary.own_reason(m.verdict, shared),
        }
        for m in trust.methods
    )

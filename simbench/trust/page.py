"""The HTML page of `simbench trust`: the conclusion, the stiction that this record could have
shown, the reliability of each method, and what would help.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from simbench.detectors.report import summary
from simbench.html.document import Pictures, Points, Section, Table, Tiles, texts, two_digits, write
from simbench.trust.pictures import draw_power, draw_pv_op, draw_trend
from simbench.trust.result import Trust

_SHOWN = 3  # detectors drawn with the best reading
_SHARES = (
    "accuracy (as advised)",
    "false positives (published)",
    "sensitivity (published)",
    "likelihood ratio",
)
_COLUMNS = (
    "Accuracy (as advised): share of simulated replicates judged rightly with the advised"
    " threshold; healthy and sticky replicates are weighted equally.",
    "False positives and sensitivity (published): shares of the healthy and of the sticky"
    " replicates"
    " called stiction with the published threshold.",
    "Likelihood ratio: how much more often sticky replicates than healthy ones get the verdict of"
    " the record; 1 means that the verdict tells nothing.",
)


def write_page(trust: Trust, path: str | Path) -> None:
    """Write a trust as one self-contained HTML page."""
    record = trust.record
    tiles = []
    if trust.probability is not None:
        tiles.append(
            (f"{trust.probability:.2f}", "probability of stiction (prior probability 0.5)")
        )
        tiles.append(
            (f"{len(trust.twins)}", "simulated replicates of this loop, judged by every method")
        )
    if trust.smallest_visible is not None:
        tiles.append(
            (
                f"{trust.smallest_visible[0]:.2g}",
                f"smallest S ({record.S_unit}) detected in 4 of 5 replicates",
            )
        )
    answer = [*texts(trust.first_lines()), *([Tiles(tiles)] if tiles else [])]
    parts = [Section("answer", "The answer", answer)]
    seen = [
        (draw_trend(record), "PV (red), SP (grey), OP (blue)"),
        (draw_pv_op(record), "PV against OP"),
    ]
    parts.append(Section("record", "The record", [Pictures(seen)]))
    if trust.power:
        best = [m for m in trust.methods if m.verdict.applicable is not False][:_SHOWN]
        curves = {"most accurate": trust.power} | {m.verdict.method: m.power for m in best}
        caption = (
            "Share of replicates called stiction, over S. Black: the reading most often right on"
            " the replicates, with its 95 % interval. Other colours: methods with their published"
            " thresholds. Dashed: 0.8"
        )
        ratios = sorted({round(c.J / c.S, 6) for c in trust.power})
        pictures = [
            (draw_power(curves, ratio, record.S_unit), f"{caption}; J = {ratio:.3g} S")
            for ratio in ratios
        ]
        shown = [Pictures(pictures)]
        parts.append(Section("power", "What this record could have shown", shown))
    table = Table(_table(trust), two_digits(*_SHARES), ["reason"])
    methods = [table, *([Points(_COLUMNS)] if trust.twins else [])]
    parts.append(Section("methods", "Which method to trust on this loop", methods))
    points = [*(r.sentence() for r in trust.helps), *trust.notes]
    # they include what reading the record assumed
    points += summary.notes_of([m.verdict for m in trust.methods], record)
    if points:
        parts.append(Section("next", "What would help, and what to know", [Points(points)]))
    write(
        path,
        f"Stiction in {record.tag or 'this loop'}: which method to trust",
        "Detectors on simulated replicates of one loop",
        parts,
    )


def _table(trust: Trust) -> pd.DataFrame:
    shared = summary.notes_of([m.verdict for m in trust.methods], trust.record)
    return pd.DataFrame(
        {
            "method": m.verdict.method,
            "verdict (published)": (
                "not applicable"
                if m.verdict.applicable is False
                else m.verdict.verdict.replace("_", " ")
            ),
            "accuracy (as advised)": m.rule.right,
            "false positives (published)": m.false_positives,
            "sensitivity (published)": sum(c.share for c in m.power) / len(m.power)
            if m.power
            else None,
            "likelihood ratio": m.likelihood_ratio,
            "advised threshold": "as published"
            if m.rule.cut is None
            else f"score above {m.rule.cut:.3g}",
            "reason": summary.own_reason(m.verdict, shared),
        }
        for m in trust.methods
    )

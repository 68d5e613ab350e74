"""Which detector when: what every method states of itself, and what was measured."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pandas as pd
from text import heading, plain, table

from simbench.bench.score.scoring import score_run
from simbench.bench.score.shipped import shipped
from simbench.detectors.method import Method
from simbench.detectors.plugins.registry import methods

RESULTS = Path(__file__).parents[3] / "results"
PARTS = ("Needs", "Parameters", "Indices", "Rule", "Not for", "Source")
ABOUT = """\
The table is what was measured, on loops whose truth is known (grid ``chapter``, {n} loops) and on
real loops ({real}). Accuracy counts no decision as not right. Below it every method states
what it needs and when not to use it. In short:

- OP and PV alone: begin with ``procedure``, which weighs the others; on loops like yours,
  ``simbench run FOLDER`` names the method to rely on.
- MV or a flow is recorded: ``yamashita``.
- The process integrates (level): a method made for self-regulating loops is left out.
- An answer that hangs on one method hangs on one wave form: read its reason (``--why``).
"""


def methods_page() -> str:
    """Return the page."""
    shares, real = measured(), real_loops()
    most = max(real.values(), key=lambda row: int(row["applicable"]))
    sticky = int(most["positives"])
    counted = f"{sticky} sticky and {int(most['applicable']) - sticky} others"
    lines = [*heading("Which detector when"), ABOUT.format(n=loops(), real=counted), ""]
    order = [*shares, *(name for name in methods.names() if name not in shares)]
    head = (
        "method",
        "right",
        "sensitivity, cycling",
        "others left alone",
        "sensitivity, real",
        "real alarms",
        "made for",
        "looks for",
    )
    lines += table(head, [_row(name, shares, real) for name in order])
    lines += [
        (
            "Figures: the verdicts on grid ``chapter`` that the package ships"
            " (``simbench.results``), and ``results/real_records.txt``; a dash was not measured."
        ),
        "",
    ]
    for name in methods.names():
        lines += [f".. _method-{name}:", "", *heading(name, "-")]
        sections = re.split(
            rf"^({'|'.join(PARTS)}):",
            (methods.load(name).__doc__ or "").split("Example", 1)[0],
            flags=re.M,
        )
        lines += [
            plain(sections[0]),
            "",
            *(f":{part}: {plain(text)}" for part, text in zip(sections[1::2], sections[2::2])),
        ]
        lines += [f":Rules not of the source: {_changed_rules(methods.load(name).METHOD)}", ""]
    return "\n".join(lines)


def _row(
    name: str, shares: dict[str, dict[str, float]], real: dict[str, dict[str, str]]
) -> tuple[str, ...]:
    about: Method = methods.load(name).METHOD
    made = ("MV; " if about.needs_mv else "") + (
        "any process" if len(about.process) == 2 else ", ".join(about.process)
    )
    share, unit = shares.get(name, {}), real.get(name)
    numbers = (
        f"{share[key]:.2f}" if key in share else r"\-" for key in ("right", "cycling", "healthy")
    )
    seen = (unit["sensitivity"], unit["false_positives"]) if unit else ("-", "-")
    seen = tuple(r"\-" if share == "-" else share for share in seen)
    return f":ref:`{name} <method-{name}>`", *numbers, *seen, made, plain(about.title)


def _changed_rules(about: Method) -> str:
    """Say which rules are none of the source's, and what they are there; `NAME@published` is the
    method without them.
    """
    rules = (
        f"{k} = {about.thresholds[k].default:g}, {v:g} in the source"
        for k, v in about.published.items()
    )
    changes = plain("; ".join(rules)) or "none"
    chapter = ", ".join(f"{k} = {v:g}" for k, v in about.chapter.items())
    return changes + (f"; in the chapter {plain(chapter)}" if chapter else "")


@cache
def _ranking() -> pd.DataFrame:
    """Return the scores of the shipped verdicts on grid chapter, all loops with a clear label."""
    return score_run(shipped("chapter")).rows("cycled", population="all")


def loops() -> int:
    """Return how many simulated loops the figures rest on."""
    return int(_ranking().n.max())


def measured() -> dict[str, dict[str, float]]:
    """Return accuracy, and the shares right on cycling and on other loops where the method applies;
    best first.
    """
    table = _ranking()
    table = table[table.method.isin(methods.names()) & (table.applicable > 0)]
    shares = {
        str(r.method): {
            "right": float(r.accuracy),
            "cycling": float(r.sensitivity),
            "healthy": 1.0 - float(r.false_positives) - float(r.no_decision_negatives),
        }
        for r in table.itertuples()
    }
    return dict(sorted(shares.items(), key=lambda item: -item[1]["right"]))


def real_loops() -> dict[str, dict[str, str]]:
    """Return the table of the real records by method."""
    blocks = (RESULTS / "real_records.txt").read_text(encoding="utf-8").split("\n\n")
    rows = next(block for block in blocks if block.startswith("method ")).splitlines()
    head = rows[0].split()
    found = (dict(zip(head, line.split())) for line in rows[1:])
    return {row["method"]: row for row in found if row["method"] in methods.names()}

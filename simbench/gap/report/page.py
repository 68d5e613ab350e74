"""Write the HTML page of a diagnosis: one self-contained file, from the answer in one sentence to
the next step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from simbench.gap.report import pictures
from simbench.gap.report import traces as runs
from simbench.gap.report.law_page import law_section
from simbench.gap.report.law_pictures import draw_lacking
from simbench.gap.report.parts import captioned, compared, render, write
from simbench.gap.report.result import GapReport, numbers, words
from simbench.html.svg import inline_svg
from simbench.html.table import sortable
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN

_MEANING = {
    NONE: "the simulation lacks nothing",
    UNKNOWN: "something that no known effect explains",
}


def write_page(
    report: GapReport, path: str | Path, command: Sequence[str] = (), account: Markup | None = None
) -> None:
    """Write a diagnosis as one self-contained HTML page, readable in light and dark and on a phone;
    `account`: its story.
    """
    tag = report.behind.found.situation.record.tag
    loop = report.fixed_loop().to_toml().strip()
    parts: list[tuple[str, str, Markup]] = [
        ("answer", "The answer", _answer(report)),
        *([("story", "What the tests changed", account)] if account is not None else []),
        ("where", "Where the gap lies", _where(report)),
        ("look", "Record and simulation", _look(report)),
        *_unnamed(report),
        ("which", "Which effect", _which(report)),
        ("shrinkage", "How far the gap shrinks", _shrinkage(report)),
        ("next", "What is open, and what to do next", _open(report)),
        (
            "reproduce",
            "How to reproduce",
            render("reproduce.html", command=list(command), loop=loop),
        ),
    ]
    title = f"{tag or 'Record'} against its simulation"
    write(path, title, "Sim-to-real gap of one control loop", parts)


def _answer(report: GapReport) -> Markup:
    g, s = report.gap, report.shrinkage
    what = {NONE: "that nothing is lacking", UNKNOWN: "of an effect not on the list"}.get(
        report.effect, f"of {words(report.effect)}"
    )
    tiles = [(f"{report.effects[0]['probability']:.2f}", f"probability {what}")]
    tiles.append((f"{g.before:.2f}", "gap between record and simulation"))
    if report.effect not in (NONE, UNKNOWN):
        tiles.append((f"{g.after:.2f}", "gap with the effect added"))
    tiles.append(
        (f"{g.floor:.2f}", "gap between two simulations of one loop (repeatability floor)")
    )
    if s is not None:
        value, lo, hi = (round(100 * s[k]) for k in ("value", "lo", "hi"))
        removed = f"of the gap above the floor is removed (90 % interval {lo} to {hi} %)"
        tiles.append((f"{value} %", removed))
    named = [
        {
            "effect": words(e["effect"]),
            "block": e["block"],
            "fitted": numbers(e["effect"], e["parameters"], ""),
            "says": _meaning(e["effect"]),
        }
        for e in report.effects
    ]
    return render(
        "answer.html", sentence=report.sentence(), tiles=tiles, named=named if report.named else []
    )


def _where(report: GapReport) -> Markup:
    shares = report.blocks
    caption = "probability of each block: " + ", ".join(
        f"{b} {100 * p:.0f} %" for b, p in shares.items()
    )
    return render(
        "where.html",
        svg=inline_svg(pictures.draw_blocks(shares), "blocks", caption),
        any=any(shares.values()),
    )


def _look(report: GapReport) -> Markup:
    record, simulated = runs.recorded(report), runs.simulated(report)
    part = (record, simulated, *runs.end_of(report.behind.found.situation))
    drawn = compared(*part)
    caption = "PV over OP: record and simulations"
    drawn.insert(2, (pictures.draw_loops("PV", *part), "pv-op", caption))
    if record.mv is not None:
        caption = "MV over OP: record and simulations"
        drawn.append((pictures.draw_loops("MV", *part), "mv-op", caption))
    return render(
        "look.html",
        items=captioned(drawn),
        added=next((n for n in (runs.FIXED, runs.NEAREST) if n in simulated), ""),
        absent=runs.BASELINE not in simulated,
        given=report.behind.found.situation.trusted,
    )


def _unnamed(report: GapReport) -> list[tuple[str, str, Markup]]:
    """Return the sections of an unknown effect: what it looks like, and what of the record the
    simulation lacks.
    """
    if report.looks_like is None:
        return []
    lacks = report.behind.loops.lacking
    body = law_section(report.looks_like)
    if lacks is not None and lacks.features:
        caption = "features of the record that the simulation lacks: " + lacks.sentence
        drawn = captioned([(draw_lacking(lacks), "lacking", caption)])
        body += render("lacking.html", items=drawn)
    return [("like", "What it looks like", body)]


def _which(report: GapReport) -> Markup:
    frame = pd.DataFrame(
        {
            "effect": [words(r.effect) for r in report.ranking],
            "block": [r.block for r in report.ranking],
            "probability": [r.probability for r in report.ranking],
            "gap before": pd.Series([r.gap_before for r in report.ranking], dtype=float),
            "gap after": pd.Series([r.gap_after for r in report.ranking], dtype=float),
            "parameters": [numbers(r.effect, r.parameters, "") for r in report.ranking],
        }
    )
    meaning = [(words(r.effect), _meaning(r.effect)) for r in report.ranking]
    table = sortable(frame, {"probability": "{:.3f}".format}, long=("parameters",))
    return render("which.html", table=table, meaning=meaning)


def _shrinkage(report: GapReport) -> Markup:
    sizes = runs.gap_sizes(report)
    caption = "gap: " + ", ".join(f"{name} {size:.2f}" for name, size in sizes.items())
    per = report.behind.shrinkage.per_feature
    last = "after" if report.named else "recalibrated"
    features = pd.DataFrame([{"feature": k, "before": b, last: a} for k, (b, a) in per.items()])
    if len(features):
        features = features.sort_values("before", ascending=False)
    return render(
        "shrinkage.html",
        svg=inline_svg(pictures.draw_gap(sizes), "gap", caption),
        says=report.gap_lines(),
        features=sortable(features, dict.fromkeys(("before", last), "{:.2f}".format))
        if len(features)
        else None,
    )


def _open(report: GapReport) -> Markup:
    sizes = report.behind.detectable
    rows = [
        {"effect": words(e), "block": EFFECTS[e].block, "smallest size": size, "unit": unit or "-"}
        for e, (size, unit) in sizes.items()
        if math.isfinite(size)
    ]
    hidden = [words(e) for e, (size, _) in sizes.items() if not math.isfinite(size)]
    return render(
        "open.html",
        group=[words(e) for e in report.group] if len(report.group) > 1 else [],
        next_test=report.next_line(),
        notes=report.notes,
        table=sortable(pd.DataFrame(rows)) if rows else None,
        hidden=hidden,
    )


def _meaning(effect: str) -> str:
    return _MEANING.get(effect) or EFFECTS[effect].says

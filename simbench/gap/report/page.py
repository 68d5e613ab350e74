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
from simbench.gap.report.parts import caption_pictures, look, render, write
from simbench.gap.report.result import GapReport, numbers, words
from simbench.gap.report.traces import compared, gap_sizes
from simbench.html.svg import inline_svg
from simbench.html.table import sortable
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN

_MEANING = {
    NONE: "the simulation lacks nothing",
    UNKNOWN: "something that no known effect explains",
}


def write_page(
    report: GapReport, path: str | Path, command: Sequence[str] = (), account: str = ""
) -> None:
    """Write a diagnosis as one self-contained HTML page, readable in light and dark and on a phone;
    `account`: its story.
    """
    situation = report.behind.found.situation
    loop = report.fixed_loop().to_toml().strip()
    parts = [
        ("answer", "The answer", _answer(report)),
        ("story", "What the tests changed", account),
        ("where", "Where the gap lies", _where(report)),
        ("look", "Record and simulation", look(compared(report), situation)),
        ("remaining", "What remains", _remaining(report)),
        ("which", "Which effect", _which(report)),
        ("shrinkage", "How far the gap shrinks", _shrinkage(report)),
        ("next", "What is open, and what to do next", _open(report)),
        ("reproduce", "How to reproduce", render("reproduce.html", command=command, loop=loop)),
    ]
    title = f"{situation.record.tag or 'Record'} against its simulation"
    write(path, title, "Sim-to-real gap of one control loop", parts)


def _answer(report: GapReport) -> Markup:
    g, s = report.gap, report.shrinkage
    what = {NONE: "that nothing is lacking", UNKNOWN: "of an effect not on the list"}.get(
        report.effect, f"of {words(report.effect)}"
    )
    p = report.probability_of_stiction
    tiles = [
        (f"{report.effects[0]['probability']:.2f}", f"probability {what}"),
        ("-" if p is None else f"{p:.2f}", "probability of stiction, all effects with friction"),
        ("yes" if g.near else "no", "near the record"),
    ]
    if s is not None:
        value, lo, hi = (round(100 * s[k]) for k in ("value", "lo", "hi"))
        removed = f"of the gap above the floor is removed (90 % interval {lo} to {hi} %)"
        tiles.append((f"{value} %", removed))
    named = [
        {
            "effect": words(e["effect"]),
            "block": e["block"],
            "fitted": numbers(e["effect"], e["parameters"], "", report.op_unit),
            "says": EFFECTS[e["effect"]].says,
        }
        for e in report.effects
        if e["effect"] in report.named
    ]
    return render(
        "answer.html",
        sentences=[report.answer(), report.nearness()],
        tiles=tiles,
        named=named,
        valve=report.conclusion.as_lines(),
    )


def _where(report: GapReport) -> Markup:
    shares = report.blocks
    each = ", ".join(f"{b} {p:.2f}" for b, p in shares.items())
    svg = inline_svg(pictures.draw_blocks(shares), "blocks", f"probability of each block: {each}")
    return render("where.html", svg=svg, any=any(shares.values()))


def _remaining(report: GapReport) -> Markup:
    """Return in which features the record differs from its simulations, the answer in them."""
    if not report.remaining:
        return Markup()
    caption = "Recorded values beside the range of the simulations, the farthest on top"
    drawn = caption_pictures([(pictures.draw_remaining(report.remaining), "remaining", caption)])
    table = pd.DataFrame([one.as_json() for one in report.remaining])
    formats = {"simulated": lambda ends: " to ".join(f"{end:.3g}" for end in ends)}
    return render("remaining.html", items=drawn, table=sortable(table, formats, long=("feature",)))


def _which(report: GapReport) -> Markup:
    frame = report.to_frame()
    frame["effect"] = frame["effect"].map(words)
    table = sortable(
        frame.rename(columns=words), {"probability": "{:.3f}".format}, long=("parameters",)
    )
    meaning = {
        words(r.effect): _MEANING.get(r.effect) or EFFECTS[r.effect].says for r in report.ranking
    }
    return render("which.html", says=report.which_lines(), table=table, meaning=meaning)


def _shrinkage(report: GapReport) -> Markup:
    sizes = gap_sizes(report)
    caption = "gap: " + ", ".join(f"{name} {size:.2f}" for name, size in sizes.items())
    columns = ["feature", "before", "after" if report.named else "recalibrated"]
    compared = report.behind.shrinkage.features.items()
    rows = [(name, one.before, one.distance) for name, one in compared]
    features = pd.DataFrame(rows, columns=columns).sort_values("before", ascending=False)
    return render(
        "shrinkage.html",
        svg=inline_svg(pictures.draw_gap(sizes), "gap", caption),
        says=report.gap_lines(),
        features=sortable(features, dict.fromkeys(columns[1:], "{:.2f}".format)),
    )


def _open(report: GapReport) -> Markup:
    columns = ["effect", "block", "smallest size", "unit"]
    sizes = report.behind.detectable.items()
    rows = [
        (words(e), EFFECTS[e].block, size, unit or "-")
        for e, (size, unit) in sizes
        if math.isfinite(size)
    ]
    return render(
        "open.html",
        next_test=report.next_line(),
        notes=report.notes,
        table=sortable(pd.DataFrame(rows, columns=columns)) if rows else None,
        hidden=[words(e) for e, (size, _) in sizes if not math.isfinite(size)],
    )

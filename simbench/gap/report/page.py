"""Write the HTML page of a diagnosis: one self-contained file, from the answer in one sentence to
the next step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from simbench.gap.report import pictures
from simbench.gap.report.ranked import numbers, words
from simbench.gap.report.result import GapReport
from simbench.gap.report.traces import compared, end_of, gap_sizes
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN
from simbench.page.document import (
    Commands,
    Details,
    Part,
    Pictures,
    Points,
    Section,
    Table,
    Text,
    Tiles,
    texts,
    two_digits,
    write,
)

_MEANING = {
    NONE: "the simulation lacks nothing",
    UNKNOWN: "something that no known effect explains",
}


def write_page(
    report: GapReport,
    path: str | Path,
    command: Sequence[str] = (),
) -> None:
    """Write a diagnosis as one self-contained HTML page, readable in light and dark and on a
    phone.
    """
    situation = report.behind.found.situation
    loop = report.fixed_loop().to_toml().strip()
    written = Details("The loop file that --write-loop writes", [Commands([loop])])
    sections = [
        Section("answer", "The answer", _answer(report)),
        Section("where", "Where the gap lies", _where(report)),
        Section("look", "Record and simulation", _look(compared(report), situation)),
        Section("remaining", "What remains", _remaining(report)),
        Section("which", "Which effect", _which(report)),
        Section("shrinkage", "How far the gap shrinks", _shrinkage(report)),
        Section("next", "What is open, and what to do next", _list_undetected(report)),
        Section(
            "reproduce",
            "How to reproduce",
            [*([Commands(command)] if command else []), written],
        ),
    ]
    title = f"{situation.record.tag or 'Record'} against its simulation"
    write(path, title, "Sim-to-real gap of one control loop", sections)


def _answer(report: GapReport) -> list[Part]:
    g = report.gap
    s = report.shrinkage
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
    named = [_describe_effect(report, e) for e in report.effects if e["effect"] in report.named]
    return [
        *texts([report.answer(), report.nearness()], "strong"),
        *texts([" ".join(report.identified())] if report.identified() else []),
        Tiles(tiles),
        *([Points(named)] if named else []),
        Text("The valve", "heading"),
        *texts(report.conclusion.as_lines()),
    ]


def _describe_effect(report: GapReport, e: Mapping[str, Any]) -> str:
    """Return what an effect that the report names is, and with which parameters it was fitted."""
    name = e["effect"]
    fitted = numbers(name, e["parameters"], "", report.op_unit)
    says = f"{words(name)} ({e['block']}): {EFFECTS[name].says}."
    return f"{says} Fitted: {fitted}." if fitted else says


def _where(report: GapReport) -> list[Part]:
    shares = report.blocks
    says = (
        "The probability that the missing effect lies in a block is the sum over the effects of"
        " that block."
        if any(shares.values())
        else "No effect is missing, so no block has a share."
    )
    return [Text(says), Pictures([(pictures.draw_blocks(shares), "Probability of each block")])]


def _look(traces: pictures.Traces, situation: Situation) -> list[Part]:
    """Return the record and its simulations in pictures: over time, over OP, and their spectra."""
    part = end_of(situation)
    shown = "record and simulations"
    drawn = [
        (pictures.draw_traces("PV", traces, part), f"PV over time, set point dotted: {shown}"),
        (pictures.draw_traces("OP", traces, part), f"OP over time: {shown}"),
        (pictures.draw_loops("PV", traces, part), f"PV over OP: {shown}"),
        (pictures.draw_spectra(traces), "Power spectra of PV and OP, whole record"),
    ]
    if all(trace.mv is not None for trace in traces.values()):
        drawn.append((pictures.draw_loops("MV", traces, part), f"MV over OP: {shown}"))
    given = "given" if situation.trusted else "identified from the record"
    given = f"the baseline as {given}, the baseline with K, T and Td recalibrated"
    lost = "" if "baseline" in traces else " The baseline runs away and is not drawn."
    if not situation.stated_parts:
        given = "the loop that was identified from the record"
        lost = ""
    added = "".join(f", and {name} added" for name in traces if name.startswith("with "))
    says = (
        f"The record beside simulations of the same length under its set point: {given}{added}."
        " Same axes; time plots show the end of the part on which nothing was fitted. Loads and"
        " noise are drawn at random, so shape, size and period should agree, not the"
        f" phase.{lost}"
    )
    return [Text(says), Pictures(drawn)]


def _remaining(report: GapReport) -> list[Part]:
    """Return in which features the record differs from its simulations, the answer in them."""
    if not report.remaining:
        return []
    caption = "Recorded values beside the range of the simulations, the farthest on top"
    table = pd.DataFrame([one.as_json() for one in report.remaining])
    formats = {"simulated": lambda ends: " to ".join(f"{end:.3g}" for end in ends)}
    return [
        Text(
            "What the record has and the simulations with the answer in them have not. Each grey"
            " bar is the range of the simulations, the dot is the record. The block is where such"
            " a difference is looked for first."
        ),
        Pictures([(pictures.draw_remaining(report.remaining), caption)]),
        Table(table, formats, long=["feature"]),
    ]


def _which(report: GapReport) -> list[Part]:
    frame = report.to_frame()
    frame["effect"] = frame["effect"].map(words)
    meaning = [
        f"{words(r.effect)}: {_MEANING.get(r.effect) or EFFECTS[r.effect].says}"
        for r in report.ranking
    ]
    return [
        *texts(report.which_lines()),
        Text(
            'Every effect that the record can show beside this baseline was fitted; "none" means'
            ' that no effect is missing, "unknown" that the missing effect is not on the list. The'
            " gap is given for the candidates that were simulated."
        ),
        Table(frame.rename(columns=words), {"probability": "{:.3f}".format}, ["parameters"]),
        Details("What the effects mean", [Points(meaning)]),
    ]


def _shrinkage(report: GapReport) -> list[Part]:
    sizes = gap_sizes(report)
    caption = "Gap: " + ", ".join(f"{name} {size:.2f}" for name, size in sizes.items())
    columns = ["feature", "before", "after" if "after" in sizes else "recalibrated"]
    compared = report.behind.shrinkage.features.items()
    rows = [(name, one.before, one.distance) for name, one in compared]
    features = pd.DataFrame(rows, columns=columns).sort_values("before", ascending=False)
    if columns[-1] not in sizes:
        features = features.drop(columns=columns.pop())
    return [
        *texts(report.gap_lines()),
        Text(
            "All distances are measured on the last part of the record, on which nothing was"
            " fitted, in features that do not depend on the phase."
        ),
        Pictures([(pictures.draw_gap(sizes), caption)]),
        Text("Gap by feature", "heading"),
        Table(features, two_digits(*columns[1:])),
    ]


def _list_undetected(report: GapReport) -> list[Part]:
    columns = ["effect", "block", "smallest size", "unit"]
    sizes = report.behind.detectable.items()
    rows = [
        (words(e), EFFECTS[e].block, size, unit or "-")
        for e, (size, unit) in sizes
        if math.isfinite(size)
    ]
    hidden = [words(e) for e, (size, _) in sizes if not math.isfinite(size)]
    parts = texts(report.next_line(), "strong")
    if report.notes:
        parts.append(Points(report.notes))
    if rows:
        unseen = f" At no size up to the largest tried: {', '.join(hidden)}." if hidden else ""
        parts += [
            Text("Smallest effect this record would have shown", "heading"),
            Text(f"A smaller effect may be there and stay unseen.{unseen}"),
            Table(pd.DataFrame(rows, columns=columns)),
        ]
    return parts

"""Show a diagnosis: its page, which says what the text says, and its picture on one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.report.pictures import (
    BASELINE,
    FIXED,
    IDENTIFIED,
    NEAREST,
    RECORD,
    SHOWN,
    TUNED,
    draw_gap,
    draw_loops,
    draw_ranking,
    draw_remaining,
    draw_traces,
    fill_gap,
    fill_ranking,
    fill_traces,
)
from simbench.gap.report.ranked import LEAST_SHOWN, Ranked, words
from simbench.gap.report.result import GapReport, joined
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, UNKNOWN
from simbench.page.document import (
    Commands,
    Details,
    Part,
    Pictures,
    Points,
    Section,
    Table,
    Text,
    texts,
    write,
)
from simbench.page.style import label, styled

_SAMPLES = 400  # of the record's end on the sheet: a few periods of most loops
_MOST = 5  # candidates: as many as fit beside the traces


def write_page(report: GapReport, path: str | Path, command: Sequence[str] = ()) -> None:
    """Write a diagnosis as one self-contained HTML page, readable in light and dark and on a
    phone.
    """
    # what repeats it
    situation = report.behind.found.situation
    loop = report.fixed_loop().to_toml().strip()
    if command:
        again: list[Part] = [Commands(command)]
    else:
        again = []

    # from the answer to the commands
    sections = [
        Section("answer", "The answer", _answer_section(report)),
        Section("look", "Record and simulation", _picture_section(report, situation)),
        Section("remaining", "What remains", _remaining_section(report)),
        Section("which", "Which effect", _effect_section(report)),
        Section(
            "reproduce",
            "How to reproduce",
            again + [Details("The loop file that --write-loop writes", [Commands([loop])])],
        ),
    ]
    title = f"{situation.record.tag or 'Record'} against its simulation"
    write(path, title, "Sim-to-real gap of one control loop", sections)


def _answer_section(report: GapReport) -> list[Part]:
    """Return what is missing, whether the valve sticks, how far the gap shrinks, and the notes."""
    sizes = gap_sizes(report)
    caption = "Gap: " + ", ".join(f"{name} {size:.2f}" for name, size in sizes.items())
    return (
        texts([report.answer(), report.nearness()], "strong")
        + texts(joined(report.identified()))
        + [Text("The valve", "heading")]
        + texts(report.conclusion.as_lines())
        + [Text("The gap", "heading")]
        + texts(report.gap_lines() + report.next_line())
        + [Pictures([(draw_gap(sizes), caption)])]
        + ([Points(report.notes)] if report.notes else [])
    )


def _picture_section(report: GapReport, situation: Situation) -> list[Part]:
    """Return the record and its simulations in pictures: over time and over OP."""
    # the pictures
    runs = compared(report)
    part = end_of(situation)
    drawn = [
        (draw_traces("PV", runs, part), "PV over time, set point dotted: record and simulations"),
        (draw_loops("PV", runs, part), "PV over OP: record and simulations"),
    ]
    if all(run.mv is not None for run in runs.values()):
        drawn.append((draw_loops("MV", runs, part), "MV over OP: record and simulations"))

    # what they show
    given = "given" if situation.trusted else "identified from the record"
    of = f"the baseline as {given}, the baseline with K, T and Td recalibrated"
    lost = "" if BASELINE in runs else " The baseline runs away and is not drawn."
    if not situation.stated_parts:
        of = "the loop that was identified from the record"
        lost = ""
    added = "".join(f", and {name} added" for name in runs if name.startswith("with "))
    says = (
        f"The record beside simulations of the same length under its set point: {of}{added}."
        " Same axes; time plots show the end of the part on which nothing was fitted. Loads and"
        " noise are drawn at random, so shape, size and period should agree, not the"
        f" phase.{lost}"
    )
    return [Text(says), Pictures(drawn)]


def _remaining_section(report: GapReport) -> list[Part]:
    """Return in which features the record differs from its simulations, the answer in them."""
    if not report.remaining:
        return []

    # a picture and the numbers
    caption = "Recorded values beside the range of the simulations, the farthest on top"
    table = pd.DataFrame([one.as_json() for one in report.remaining])
    formats = {"simulated": lambda ends: " to ".join(f"{end:.3g}" for end in ends)}
    return [
        Text(
            "What the record has and the simulations with the answer in them have not. Each grey"
            " bar is the range of the simulations, the dot is the record. The block is where such"
            " a difference is looked for first."
        ),
        Pictures([(draw_remaining(report.remaining), caption)]),
        Table(table, formats, long=["feature"]),
    ]


def _effect_section(report: GapReport) -> list[Part]:
    """Return every effect with its probability, and what each says."""
    # the ranking with what each effect means
    frame = report.to_frame()
    says = {
        "none": "the simulation lacks nothing",
        UNKNOWN: "something that no known effect explains",
        **{effect: EFFECTS[effect].says for effect in frame["effect"] if effect in EFFECTS},
    }
    frame["meaning"] = frame["effect"].map(says)
    frame["effect"] = frame["effect"].map(words)

    # beside a picture of the first
    top = _most_probable(report)
    table = Table(
        frame.rename(columns=words), {"probability": "{:.3f}".format}, ["parameters", "meaning"]
    )
    return texts(report.which_lines()) + [
        Pictures([(draw_ranking(top), "Probability of each effect")]),
        table,
    ]


def _most_probable(report: GapReport) -> dict[str, float]:
    top = [r for r in report.ranking if r.probability >= LEAST_SHOWN][:_MOST]
    return {words(r.effect): r.probability for r in top}


@styled
def draw_sheet(report: GapReport) -> Figure:
    """Draw record and simulations over time at the left, probabilities and gap at the right."""
    # over time
    traces = compared(report)
    figure = Figure(figsize=(9.0, 1.2 + 0.95 * len(traces)), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.5, 1.0], squeeze=False)[0]
    end = end_of(report.behind.found.situation, _SAMPLES)
    fill_traces(left.subplots(len(traces), 1, sharex=True, squeeze=False)[:, 0], "PV", traces, end)

    # what is missing, and how far it helps
    which, gap = right.subplots(2, 1)
    fill_ranking(which, _most_probable(report))
    fill_gap(gap, gap_sizes(report))
    label(which, "probability", "", "what is missing")
    distance = "distance from the record\n(seed-to-seed standard deviations)"
    label(gap, distance, "", "gap between simulation and record")
    return figure


def nearest(report: GapReport) -> Ranked | None:
    """Return the known effect closest to an unknown one; None where the answer is known or nothing
    comes close.
    """
    fitted = (r for r in report.ranking if r.effect in EFFECTS and r.gap_after is not None)
    if report.effect == UNKNOWN:
        return next(fitted, None)
    return None


def gap_sizes(report: GapReport) -> dict[str, float]:
    """Return the gap of every simulation, and both floors, in seed-to-seed standard deviations."""
    g = report.gap
    near = nearest(report)
    sizes = {"before": g.before}
    if report.behind.found.situation.stated_parts:
        sizes["recalibrated"] = g.recalibrated
    if report.named or report.behind.shown:
        sizes["after"] = g.after
    if near is not None and near.gap_after is not None:
        sizes["nearest effect"] = near.gap_after
    return sizes | {"floor": g.floor, "plant floor": g.plant_floor}


def record_in_percent(situation: Situation) -> LoopRecord:
    """Return the record as the diagnosis saw it: OP in %, a set point that was not recorded too."""
    record = situation.record
    return LoopRecord(situation.op, record.pv, record.Ts, situation.sp, record.mv)


def compared(report: GapReport) -> dict[str, LoopRecord]:
    """Return the record, and simulations of its length with the baseline, the recalibrated loop and
    the loop with the named (or nearest) effect; what cannot be simulated is left out.
    """
    # the loops by what they are called
    runs = report.behind.loops
    near = nearest(report)
    before, tuned, _ = runs.runs_with(report.named)

    # an identified loop needs no other calibration
    loops = {IDENTIFIED: before.loop}
    if before is not tuned:
        loops = {BASELINE: before.loop, TUNED: tuned.loop}
    shown = report.named or ([near.effect] if near else [])
    if report.behind.shown:
        loops[SHOWN] = report.behind.shown.loop
    elif shown:
        loops[FIXED if report.named else NEAREST] = runs.corrected(shown)

    # a record of each, in the samples of the record
    found = {}
    for name, loop in loops.items():
        found[name] = run_with_seeds(loop, 0, 1)
    s = report.behind.found.situation
    return {RECORD: record_in_percent(s)} | {
        name: records[0].with_signals(lambda x: x[:: s.pace], Ts=s.record.Ts)
        for name, records in found.items()
        if records
    }


def end_of(situation: Situation, most: int = 1200) -> slice:
    """Return the end of the held-out part, at most so many samples."""
    n = situation.record.n
    return slice(max(held_out(situation), n - most), n)

"""Write the HTML page of `simbench detect`: the conclusion, the record, and the verdict of every
method with its reason.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.record import LoopRecord
from simbench.detectors.report import summary
from simbench.detectors.report.report import Report
from simbench.detectors.verdict import PROBABILITY
from simbench.page.document import (
    Commands,
    Part,
    Pictures,
    Points,
    Section,
    Table,
    texts,
    two_digits,
    write,
)
from simbench.page.style import (
    BLUE,
    SIGNAL,
    label,
    panels,
    styled,
)

_SHOWN = 12  # records drawn on one page
_COLUMNS = (
    "Score: each method has its own scale; a larger score makes stiction more likely.",
    "S, J: stick band and slip-jump that the method estimates.",
    "Applicable: whether the publication of the method covers such a loop.",
    "The conclusion above does not count these verdicts. It compares models of the loop with and"
    " without valve friction (method likelihood).",
)


def write_page(report: Report, path: str | Path, command: str = "") -> None:
    """Write conclusions and verdicts as one self-contained HTML page, with the command that made
    it; of a folder the first table has one row per loop.
    """
    # the answer, or the loops by it
    groups = report.groups()
    if report.of_folder:
        parts = [_ranking_section(report)]
    else:
        name, verdicts, _ = groups[0]
        if name in report.conclusions:
            lines = report.conclusions[name].as_lines()
        else:
            lines = []
        answer = lines + [f"Methods: {summary.sentence(verdicts)}."]
        parts = [Section("answer", "The answer", texts(answer))]

    # the first records in pictures
    for number, (name, verdicts, record) in enumerate(groups[:_SHOWN]):
        if record is not None:
            title = name or record.tag or "The record"
            seen = [
                (draw_trend(record), "The record: PV (orange), SP (grey), OP (blue)"),
                (draw_pv_op(record), "PV against OP"),
            ]
            shown: list[Part] = [Pictures(seen)]
            if notes := summary.notes_of(verdicts, record):
                shown.append(Points(notes))
            parts.append(Section(f"record-{number}", title, shown))

    # what each method says, and how to repeat it
    table = Table(_verdict_table(report), two_digits("score"), ["reason"])
    parts.append(Section("methods", "Every method", [table, Points(_COLUMNS)]))
    if command:
        parts.append(Section("reproduce", "How to reproduce", [Commands([command])]))
    write(
        path,
        "Does the valve stick?",
        f"{len(groups)} record{'s' * (len(groups) != 1)} judged",
        parts,
    )


def _ranking_section(report: Report) -> Section:
    # a row a loop, in words
    frame = report.loops()
    frame["conclusion"] = frame["conclusion"].replace(summary.CONCLUDED)
    shown = ["record", "conclusion", PROBABILITY, "cause", "event", "reason", "next"]
    frame = frame[shown].rename(columns=lambda name: name.replace("_", " "))
    table = Table(
        frame, two_digits(PROBABILITY.replace("_", " ")), long=["cause", "reason", "next"]
    )

    # what is not in the table
    says = ["Event: loops with the same number share one oscillation."]
    if len(report.records) > _SHOWN:
        says.append(
            f"The first {_SHOWN} of {len(report.records)} loops are drawn below, those in which"
            " stiction is most probable."
        )
    return Section("loops", "The loops", [table, Points(says)])


def _verdict_table(report: Report) -> pd.DataFrame:
    # what is said of a record once is not said of every method
    shared = {}
    for name, verdicts, record in report.groups():
        shared[name] = summary.notes_of(verdicts, record)

    # a row a verdict
    return pd.DataFrame(
        {
            **({} if name is None else {"record": name}),
            "method": v.method,
            "verdict": summary.VERDICT_WORDS[v.verdict],
            "score": v.score,
            "S, J": "" if v.S is None else f"{summary.level(v.S)}, {summary.level(v.J)} {v.S_unit}",
            "applicable": summary.FITS[v.applicable],
            "reason": summary.own_reason(v, shared.get(name, ())),
        }
        for name, v in report.verdicts
    )


# --- Draw a record: its trend, and PV against OP.

_POINTS = 700  # drawn of a trend; a longer record is drawn by the extremes of its pieces


@styled
def draw_trend(record: LoopRecord) -> Figure:
    """Draw PV (with SP) above OP over time."""
    # two panels with room for numbers of any width
    figure, axes = panels(2, 1, 5.0, 2.6, sharex=True)
    _place_axes(figure, left=0.18, right=0.985, bottom=0.165, top=0.93, hspace=0.12)
    above, below = axes.ravel()

    # each signal, thinned, in its colour
    hours = 3600.0 if record.duration > 7200 else 60.0
    for ax, signals in ((above, ("sp", "pv")), (below, ("op",))):
        for name in signals:
            x = getattr(record, name)
            if x is not None:
                k = _thin_samples(x)
                ax.plot(record.t[k] / hours, x[k], color=SIGNAL[name.upper()], lw=0.8)

    # names and units
    label(above, "", "PV" if record.sp is None else "PV, SP")
    label(below, "time (h)" if hours == 3600.0 else "time (min)", _op_label(record))
    return figure


@styled
def draw_pv_op(record: LoopRecord) -> Figure:
    """Draw PV against OP."""
    figure, axes = panels(1, 1, 2.6, 2.6)
    _place_axes(figure, left=0.35, right=0.965, bottom=0.165, top=0.93)
    ax = axes.ravel()[0]
    k = np.unique(np.linspace(0, record.n - 1, min(record.n, 2 * _POINTS)).astype(int))
    ax.plot(record.op[k], record.pv[k], color=BLUE, lw=0.5, alpha=0.8)
    label(ax, _op_label(record), "PV")
    return figure


def _place_axes(figure: Figure, **edges: float) -> None:
    """Put the axes where numbers of any width fit; to measure these takes as long as to draw, and a
    plant has hundreds.
    """
    figure.set_layout_engine(None)
    figure.subplots_adjust(**edges)


def _op_label(record: LoopRecord) -> str:
    return "OP" if record.op_percent is None else "OP (%)"


def _thin_samples(x: np.ndarray) -> np.ndarray:
    """Return which samples to draw: all of a short signal, the extremes of every piece of a long
    one.
    """
    if x.size <= 2 * _POINTS:
        return np.arange(x.size)
    size = -(-x.size // _POINTS)
    pieces = np.pad(x, (0, -x.size % size), mode="edge").reshape(-1, size)
    ends = np.concatenate([pieces.argmin(axis=1), pieces.argmax(axis=1)]) + np.tile(
        np.arange(len(pieces)) * size, 2
    )
    return np.unique(np.minimum(ends, x.size - 1))

"""Draw the diagnosis procedure as a flow chart from its steps, with the path of one diagnosis
marked.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.detectors.procedure import CONCLUSIONS, FLOW
from simbench.figures._marks import arrow
from simbench.page.style import BLACK, BLUE, GREY, RED, VERDICT, styled, write_picture

if TYPE_CHECKING:
    from simbench.detectors.procedure import Diagnosis

# inches
_BOX = 2.9  # width of a question
_GAP = 1.35  # room for an answer
_LINE = 0.155  # height
_PAD = 0.12  # margin


def flow_table() -> pd.DataFrame:
    """Return the procedure as one row per answer: source, question, answer, target, verdict,
    next.
    """
    rows = []
    for source, (question, answers) in FLOW.items():
        for answer, target in answers.items():
            verdict, following = CONCLUSIONS.get(target, ("", ""))
            rows.append([source, question, answer, target, VERDICT.get(verdict, ""), following])
    return pd.DataFrame(rows, columns=["source", "question", "answer", "target", "verdict", "next"])


@styled
def draw_flow(table: pd.DataFrame, taken: Collection[tuple[str, str]] = ()) -> Figure:
    """Draw questions downwards and conclusions next to the question that leads to them."""
    questions = list(dict.fromkeys(table["source"]))
    texts = {
        q: textwrap.fill(part["question"].iloc[0], 36)
        for q, part in table.groupby("source", sort=False)
    }
    ends: dict[str, list[str]] = {}
    for q in questions:
        ends[q] = []
    conclusions = {}
    for row in table[table["verdict"] != ""].to_dict("records"):
        if row["target"] not in conclusions:
            ends[row["source"]].append(row["target"])
            conclusions[row["target"]] = row["verdict"] + "\n" + textwrap.fill(row["next"], 52)

    # rows from the top, as high as their texts
    heights = {}
    for name, text in {**texts, **conclusions}.items():
        heights[name] = (text.count("\n") + 1) * _LINE + 2 * _PAD
    top = 0.0
    middle = {}
    for q in questions:
        stacked = sum(heights[c] + 0.14 for c in ends[q]) - (0.14 if ends[q] else 0.0)
        tall = max(heights[q], stacked)
        middle[q] = top - tall / 2
        at = top - tall / 2 + stacked / 2
        for c in ends[q]:
            middle[c] = at - heights[c] / 2
            at -= heights[c] + 0.14
        top -= tall + 0.34
    place = {}
    for i, q in enumerate(questions):
        place[q] = i
    skips = []
    for s, t in zip(table["source"], table["target"]):
        if place.get(t, 0) > place[s] + 1:
            skips.append((s, t))
    left = 0.3 + 0.42 * len(skips)
    wide = left + _BOX + _GAP + 4.1
    figure = Figure(figsize=(wide, -top - 0.34 + 0.2))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, wide), ylim=(top + 0.34 - 0.1, 0.1))
    axes.set_axis_off()

    for q in questions:
        frame = left, middle[q], _BOX, heights[q]
        _draw_box(axes, frame, texts[q], BLUE, q in {s for s, _ in taken})
    for source, target in dict.fromkeys(zip(table["source"], table["target"])):
        part = table[(table["source"] == source) & (table["target"] == target)]
        # of several answers with one target only the one taken is named
        named = [a for a in part["answer"] if (source, a) in taken] or list(part["answer"])
        answers = " / ".join(named)
        ink = RED if (source, named[0]) in taken else BLACK
        y = middle[source]
        z = middle[target]
        if target in conclusions:
            x = left + _BOX + _GAP
            bend = left + _BOX + 0.2
            straight = len(ends[str(source)]) < 2
            if straight:
                path = [(left + _BOX, y), (x, z)]
            else:
                path = [(left + _BOX, y), (bend, y), (bend, z), (x, z)]
            at = z
            if target not in ends[source]:
                # it is drawn next to an earlier question, whose answer is named there: this one
                # where it leaves
                at = y + 0.35 * heights[source]
                low = z - 0.25 * heights[target]
                lane = x - 0.15
                path = [(left + _BOX, at), (lane, at), (lane, low), (x, low)]
            _draw_arrow(axes, path, ink)
            axes.text(
                bend + 0.05,
                at + 0.04,
                textwrap.fill(answers, 17),
                fontsize=7.5,
                va="bottom",
                color=ink,
            )
        elif place[str(target)] == place[str(source)] + 1:
            x = left + _BOX / 2
            _draw_arrow(axes, [(x, y - heights[source] / 2), (x, z + heights[target] / 2)], ink)
            axes.text(
                x + 0.07, y - heights[source] / 2 - 0.05, answers, fontsize=7.5, va="top", color=ink
            )
        else:
            lane = left - 0.3 - 0.42 * skips.index((str(source), str(target)))
            _draw_arrow(axes, [(left, y), (lane, y), (lane, z), (left, z)], ink)
            axes.text(lane + 0.04, y + 0.04, answers, fontsize=7.5, va="bottom", color=ink)
    for c, text in conclusions.items():
        pairs = table[table["target"] == c][["source", "answer"]].itertuples(index=False, name=None)
        reached = any(p in taken for p in pairs)
        frame = left + _BOX + _GAP, middle[c], 3.95, heights[c]
        _draw_box(axes, frame, text, GREY, reached, bold=True)
    return figure


def draw_path(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write a picture of the procedure with the path one diagnosis took."""
    write_picture(draw_flow(flow_table(), {(s.step, s.answer) for s in diagnosis.steps}), path)


def _draw_box(
    axes: Axes,
    frame: tuple[float, float, float, float],
    text: str,
    edge: str,
    marked: bool,
    bold: bool = False,
) -> None:
    """Draw a box; `frame`: its left edge, the middle of its height, its width and its height."""
    from matplotlib.patches import FancyBboxPatch

    x, y, width, height = frame
    style = "round,pad=0,rounding_size=0.06"
    face = "#FBE9DF" if marked else "white"
    ink = RED if marked else edge
    look = {"facecolor": face, "edgecolor": ink, "linewidth": 1.1}
    axes.add_patch(FancyBboxPatch((x, y - height / 2), width, height, style, **look))
    if not bold:
        axes.text(x + width / 2, y, text, ha="center", va="center", fontsize=8.5)
        return
    head, _, rest = text.partition("\n")
    top = y + height / 2 - _PAD
    axes.text(x + 0.1, top, head, va="top", fontsize=8.5, fontweight="bold")
    axes.text(x + 0.1, top - _LINE, rest, va="top", fontsize=8)


def _draw_arrow(axes: Axes, points: list[tuple[float, float]], colour: str) -> None:
    axes.plot(*zip(*points[:-1]), color=colour, linewidth=1.0, solid_joinstyle="miter")
    arrow(axes, points[-2], points[-1], "-|>", color=colour, linewidth=1.0, mutation_scale=9)

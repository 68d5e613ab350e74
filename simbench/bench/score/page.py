"""Write the page of a ranking: its sentences and table, where each method is right, ROC curves,
false positives by cause, and the commands that repeat the run.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.figure import Figure
from scipy.stats import rankdata

from simbench.bench.score.names import LEAST, ROLE_YARDSTICK
from simbench.bench.score.picture import bars, sides
from simbench.bench.score.result import Scores
from simbench.bench.score.table import opening_lines
from simbench.bench.statistics import auc
from simbench.bench.store.benchmark import benchmark_text
from simbench.bench.store.manifest import FROM_FILE
from simbench.bench.store.reading import CODES, RunArrays
from simbench.detectors.verdict import STICTION
from simbench.page.document import (
    Commands,
    Part,
    Pictures,
    Points,
    Section,
    Table,
    Text,
    texts,
    two_digits,
    write,
)
from simbench.page.style import GREY, label, panel, series, styled
from simbench.usage import setting_words

_COLUMNS = ("cost", "accuracy", "sensitivity", "false_positives", "no_decision")
_SAYS = (
    "Cost is the mean loss: a wrong answer costs 1, no decision 0.5, a right answer 0. Accuracy is"
    " the share of right answers; no decision counts as not right. Sensitivity is the share of the"
    " cycling loops called stiction, false positives the share of the other loops. Applies: share"
    " of the loops that the publication of the method covers; the other columns count these loops"
    " only. Small figures are 95 % intervals.",
    "Rank 1: no method costs less by a difference that these loops resolve between the two. Rank"
    " 2: only methods of rank 1 do, and so on. Methods that need the valve position (MV) are ranked"
    " among themselves. A method that answers fewer than nine tenths of the loops has no rank; one"
    " of your own is then ranked on the loops that it answers. Reference rows are no detectors: the"
    " oracle answers the label, and no_waveform is a classifier that sees period, amplitude and"
    " noise, but no waveform. A useful detector costs less than no_waveform. Each column can be"
    " sorted.",
)
_BAND = "S_over_2J"
_AXES = {"self-regulating": "Td_over_T", "integrating": "Td_over_Ti"}
_BAR = 0.6  # inches, for the scale below the maps
_SIDE = 3  # maps beside each other
_PALE = 0.35  # opacity of a cell of fewer than `LEAST` loops
_ORIGIN = ("grid", "grid_hash", "records_hash", "seed", "commit", "code", "machine", "command")


def write_page(
    scores: Scores, folder: str | Path, path: str | Path, truth: str = "cycled", failed: str = ""
) -> None:
    """Write the page of a run's ranking as one self-contained HTML file.

    Parameters
    ----------
    scores : Scores
        Of the run.
    folder : str or Path
        Where the run lies.
    path : str or Path
        HTML file to write.
    truth : str
        The label that answers are compared with: cycled, predicted or sticky.
    failed : str
        A sentence on what failed in the run.
    """
    manifest = scores.manifest
    sections = [
        Section("ranking", "Ranking", _draw_ranking(scores, truth, failed)),
        Section("maps", "Maps", _draw_maps(scores, truth)),
        Section("roc", "ROC", _draw_roc_curves(scores.book)),
        Section("causes", "False positives by cause", _list_causes(scores)),
        Section("provenance", "Provenance", _tell_origin(manifest, str(folder))),
    ]
    grid = f"grid {manifest['grid']} ({manifest['grid_hash']}){benchmark_text(manifest)}"
    origin = f"commit {str(manifest.get('commit') or 'unknown')[:12]}, {grid}"
    title = f"Stiction detectors on {manifest['grid']}"
    write(path, title, origin, sections, footer=f"Every number: {origin}.")


def _draw_ranking(scores: Scores, truth: str, failed: str) -> list[Part]:
    """Draw what each method is right on and costs, and list the ranking as the text does."""
    # the sentences of the text
    rows = scores.rows(truth)
    parts = texts(opening_lines(scores, truth))
    if failed:
        parts += [Text(f"{failed}.", "bad")]
    if rows.empty:
        return parts

    # what each method is right on, the ranking, and what each costs
    right = "Of the loops that the valve makes cycle and of the others: right, open, wrong"
    cost = "Cost of each method, with its 95 % interval"
    parts.append(Pictures([(sides(rows).figure, right)], wide=True))
    for group, some in rows.groupby("group", sort=False):
        # methods that are not ranked with each other stand under a heading of their own
        name = str(group)
        if name:
            parts += [Text(name[0].upper() + name[1:], "heading")]
        parts.append(tabulate(some))
    parts.append(Pictures([(bars(scores.ranking(truth)).figure, cost)], wide=True))
    return parts + [Text("What the columns mean", "heading")] + texts(_SAYS)


def tabulate(rows: pd.DataFrame) -> Table:
    """Return one row per method with the columns that a reader compares."""
    # a rank on a part of the loops says so
    names = []
    for r in rows.itertuples():
        names.append(
            f"{r.method} (ranked on the {r.rank_loops} loops that it answers)"
            if r.partial and not math.isnan(r.rank)
            else r.method
        )
    table = pd.DataFrame({"rank": rows["rank"].astype(float), "method": names})

    # each rate with its interval beside it
    beside = {}
    for column in _COLUMNS:
        name = column.replace("_", " ")
        table[name] = rows[column]
        ends = zip(rows[f"{column}_lo"], rows[f"{column}_hi"], strict=True)
        beside[name] = ["" if math.isnan(lo) else f"{lo:.2f}-{hi:.2f}" for lo, hi in ends]

    # Where each method applies, and where it was fitted
    table["applies"] = rows["applicable"] / rows["n"]
    told = {"fitted here": "on this grid", "siblings": "on loops like these"}
    fitted = rows["home"].map(told)
    if any(fitted.notna()):
        table["fitted"] = fitted.fillna("")
    formats = {**two_digits(*beside, "applies"), "rank": "{:.0f}".format}
    return Table(table, formats, beside=beside)


def _draw_maps(scores: Scores, truth: str) -> list[Part]:
    """Draw one map per method and kind of plant: accuracy over dead time and S/2J."""
    # the kinds of plants that the grid has
    pictures = []
    for process, axis in _AXES.items():
        rates = scores.along([_BAND, axis], truth)
        if len(rates):
            caption = f"Accuracy of each method, {process} loops"
            pictures.append((draw_maps(rates, axis), caption))
    if not pictures:
        return [Text("This grid has no axes of dead time and S/2J.")]

    # what the maps show
    says = (
        "Accuracy against the label above, over dead time and S/2J; no decision counts as"
        " wrong. A healthy loop stands in the cell of its sticky siblings. Below the share stands"
        f" the number of loops; pale cells have fewer than {LEAST}."
    )
    return [Text(says), Pictures(pictures, wide=True)]


def draw_maps(rates: pd.DataFrame, axis: str) -> Figure:
    """Draw the accuracy of each method over S/2J (down) and another axis (across), with the number
    of loops in each cell; cells of few loops are pale.
    """
    # the cells of every map, and a figure that has room for them
    methods = list(dict.fromkeys(rates["method"]))
    down = list(dict.fromkeys(rates[_BAND]))
    across = list(dict.fromkeys(rates[axis]))
    deep = -(-len(methods) // _SIDE)
    size = (_SIDE * (0.9 + 0.55 * len(across)), deep * (0.9 + 0.42 * len(down)) + _BAR)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(deep, _SIDE, squeeze=False).ravel()
    edges = [np.arange(len(values) + 1) - 0.5 for values in (down, across)]
    look = {"vmin": 0.0, "vmax": 1.0, "cmap": colormaps["cividis"].resampled(20)}

    # few colours in a mesh: a page then holds lines, and no embedded image
    image = None
    for axes, method in zip(panels, methods, strict=False):
        mine = rates[rates.method == method].pivot(index=_BAND, columns=axis)
        shares = mine["accuracy"].reindex(index=down, columns=across).to_numpy()
        n = mine["n"].reindex(index=down, columns=across).to_numpy()
        few = n < LEAST
        alpha = np.where(few, _PALE, 1.0)
        image = axes.pcolormesh(edges[1], edges[0], shares, alpha=alpha, **look)
        for (i, j), share in np.ndenumerate(shares):
            if np.isfinite(share):
                # black follows the page from light to dark, as pale cells do; a full one stays
                if few[i, j]:
                    ink = "black"
                elif share < 0.55:
                    ink = "#fefefe"
                else:
                    ink = "#111111"
                text = f"{share:.2f}\n{n[i, j]:.0f}"
                axes.text(j, i, text, ha="center", va="center", fontsize=6, color=ink)
        axes.invert_yaxis()
        axes.set_xticks(range(len(across)), across, fontsize=7)
        axes.set_yticks(range(len(down)), down, fontsize=7)
        axes.set(xlabel=axis, ylabel=_BAND, title=method)
    for axes in panels[len(methods) :]:
        axes.set_axis_off()

    # one scale for all of them
    if image is not None:
        bar = figure.colorbar(image, ax=list(panels), location="bottom", shrink=0.4, aspect=40)
        bar.set_label("accuracy")
    return figure


def _draw_roc_curves(book: RunArrays | None) -> list[Part]:
    """Draw one ROC curve per detector, the largest area first, with the point that its published
    threshold sits on.
    """
    # the detectors whose scores tell at least one cycling loop from one that rests
    if book is None:
        return []
    curves = []
    clear = book.truth["cycled"] >= 0
    for i, method in enumerate(book.methods):
        here = clear & (book.applicable[i] != 0) & ~np.isnan(book.score[i])
        positive = book.truth["cycled"][here] == 1
        role = book.manifest["methods"][method].get("role", STICTION)
        if role != STICTION or not 0 < positive.sum() < positive.size:
            continue
        score = book.score[i][here].astype(float)
        called = book.verdict[i][here] == CODES[STICTION]
        area = auc(score, positive)
        told = f"{method}  {area.value:.2f} ({area.lo:.2f}-{area.hi:.2f})"
        published = called[~positive].mean(), called[positive].mean()
        curves.append((area.value, told, roc_curve(score, positive), published))
    if not curves:
        return [Text("No curve can be drawn: the run holds cycling or healthy loops only.")]

    # all in one picture
    curves.sort(key=lambda curve: -curve[0])
    says = (
        "Every threshold on the score at once, the largest area first; a dot is the published"
        " threshold. The label is whether the valve makes the loop cycle; scores are those after"
        " the oscillation front end, records without a score left out. An area of 0.5 is guessing."
    )
    caption = "Areas: " + ", ".join(" ".join(told.split()) for _, told, *_ in curves)
    return [Text(says), Pictures([(_draw_curves(curves), caption)], wide=True)]


def roc_curve(score: np.ndarray, positive: np.ndarray) -> np.ndarray:
    """Return false positives and sensitivity as the threshold falls through all scores, a row
    each.
    """
    from sklearn import metrics  # here, for it takes a second to load

    # by ranks the curve is the same, and finite
    alarms, hits, _ = metrics.roc_curve(positive, rankdata(score), drop_intermediate=False)
    return np.array([alarms, hits])


@styled
def _draw_curves(curves: Sequence[tuple[float, str, np.ndarray, tuple[float, ...]]]) -> Figure:
    figure, axes = panel(7.6, 4.6)
    axes.plot([0, 1], [0, 1], color=GREY, linestyle=":", linewidth=0.9)
    for i, (_, told, points, published) in enumerate(curves):
        colour, line = series(i)
        axes.plot(*points, line, color=colour, linewidth=1.4, label=told)
        axes.plot(*published, "o", color=colour, markersize=5)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    label(axes, "false positives (share of healthy)", "sensitivity (share of cycling)")
    place = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0)}
    axes.legend(**place, title="area (95 % interval)", alignment="left")
    return figure


def _list_causes(scores: Scores) -> list[Part]:
    """List false positives by what makes a loop oscillate whose valve does not."""
    rows = scores.by_cause
    if len(rows):
        rows = rows[rows.role != ROLE_YARDSTICK]
    if rows.empty:
        return []
    of_each = "; ".join(f"{c} {n}" for c, n in rows.groupby("cause", sort=False).n.max().items())
    table = rows.pivot(index="method", columns="cause", values="false_positives").reset_index()
    formats = two_digits(*table.columns[1:])
    return [Text(f"Of loops that the valve does not make cycle: {of_each}."), Table(table, formats)]


def _tell_origin(manifest: Mapping[str, Any], folder: str) -> list[Part]:
    """Return what the numbers rest on, and the commands that repeat them."""
    # What the run was made of
    origin = []
    for key in _ORIGIN:
        if manifest.get(key):
            origin.append(f"{key.replace('_', ' ')}: {manifest[key]}")
    versions = ", ".join(f"{name} {v}" for name, v in manifest.get("versions", {}).items())
    one = f"simbench simulate --from {folder} --id SCENARIO -o record.csv"

    # How to repeat it
    return [
        Text(f"All numbers on this page come from the tables in {folder}, and these from:"),
        Points(origin + [f"versions: {versions}"]),
        Text("How to reproduce", "heading"),
        Commands(reproduce(manifest)),
        Text("One scenario:"),
        Commands([one, "simbench detect record.csv"]),
    ]


def reproduce(manifest: Mapping[str, Any]) -> list[str]:
    """Return the commands that give the same tables from a checkout of the same commit."""
    # The run with its settings and methods
    words = ["simbench", "run", str(manifest["grid"]), "-o", "again"]
    words += setting_words({**(manifest.get("overrides") or {}), "seed": manifest["seed"]})
    methods = manifest["methods"].items()
    asked = []
    for name, about in methods:
        if about.get("answered") != FROM_FILE:
            asked.append(name)
    for name in asked:
        for word in ("--method", name):
            words.append(word)
    if manifest.get("points"):
        words += ["--n", str(manifest["points"])]

    # At its commit
    if manifest.get("commit"):
        lines = [f"git checkout {manifest['commit']}"]
    else:
        lines = []
    return lines + [shlex.join(words), "simbench score again"]

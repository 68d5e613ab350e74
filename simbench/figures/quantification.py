"""Quantification: errors of S and J as estimated by each method, by family of valves, and the
coverage of the intervals.

Left and middle: median error as a share of the valve's S. Right: share of the stated intervals for
S or J that contain the true value, with its 95 % interval, for methods that state 90 % intervals
(grey band: 0.87 to 0.93). *: fitted on this grid, +: fitted on a related grid.
"""

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score.names import HOME_MARKS, LEAST
from simbench.bench.score.quantification import quantification
from simbench.bench.score.scoring import home_of
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import RunArrays
from simbench.detectors.errors import ParameterError
from simbench.figures._style import GREY, label, panels, styled

SOURCE = "own"
_MARKS = "osD^vPX<>*"


def data(run: str | Path) -> pd.DataFrame:
    """Score S and J by method and family of valves.

    Columns: method, family, parameter, n, median_error, coverage, width, lo and hi of the coverage,
    home (where the method's constants were fitted); families of 20 and more.
    """
    book = RunArrays.read(run)
    scored = quantification(book)
    scored = scored[scored.n >= LEAST].reset_index(drop=True)
    if scored.empty:
        raise ParameterError(
            f"{run}: no method gives S or J of {LEAST} sticky loops of a family of valves"
        )
    lo, hi = wilson(scored.coverage * scored.n, scored.n)
    return scored.assign(lo=lo, hi=hi, home=[home_of(method, book) for method in scored.method])


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw errors of S and J, and coverage, one line for a family."""
    families = sorted(set(data.family))
    figure, (axes,) = panels(1, 3, 8.6, 1.7 + 0.3 * len(families), sharey=True)
    marks = {
        m: (mark, f"C{k}")
        for k, (m, mark) in enumerate(zip(dict.fromkeys(data.method), _MARKS, strict=False))
    }
    for key, rows in data.groupby(["method", "parameter"], sort=False):
        method, parameter = tuple(key)  # type: ignore[arg-type]
        place = [-families.index(f) for f in rows.family]
        mark, colour = marks.get(method, (".", GREY))
        look = {"marker": mark, "color": colour, "linestyle": "none", "fillstyle": "none"}
        look["label"] = method + HOME_MARKS[rows.home.iloc[0]]
        axes[int(parameter == "J")].plot(rows.median_error, place, **look)
        known = rows[rows.coverage.notna()]
        if len(known):
            reach = [known.coverage - known.lo, known.hi - known.coverage]
            place = [-families.index(f) for f in known.family]
            look = {**look, "capsize": 2}
            axes[2].errorbar(known.coverage, place, xerr=reach, **look)
    axes[2].axvspan(0.87, 0.93, color=GREY, alpha=0.3, linewidth=0)
    for ax, title in zip(
        axes, ("error of S / S", "error of J / S", "intervals that hold the truth"), strict=True
    ):
        label(ax, title, "", "")
        ax.set_yticks([-i for i in range(len(families))], families)
        ax.grid(axis="x", linewidth=0.4, alpha=0.6)
        ax.set_xlim(left=0.0)
    axes[2].set_xlim(0.5, 1.0)
    shown = {
        name: line
        for ax in axes[:2]
        for line, name in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        shown.values(), shown.keys(), loc="outside upper center", ncols=len(shown), fontsize=7
    )
    return figure

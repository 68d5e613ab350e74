"""Horch's verdict over w Ti, for sticky loops and for healthy ones under a sine of the same period:
it depends on w Ti.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.store.reading import read_table
from simbench.detectors.errors import ParameterError
from simbench.detectors.verdict import STICTION
from simbench.figures._style import BLUE, GREY, RED, label, note, panel, styled

SOURCE = (
    "own; Horch (1999), Eqs 11.6 to 11.9 of Jelali (2013): dtau = (2/pi) atan(1/(w Ti)) of any"
    " linear PI loop"
)
BOUNDS = {
    "stiction": (2 / 3, 1 / np.sqrt(3)),
    "no_stiction": (1 / 3, np.sqrt(3)),
}  # dtau, and w Ti that gives it
VALVES = {True: ("sticky valve", RED, "o"), False: ("healthy valve under a sine", BLUE, "s")}


def data(run: str | Path) -> pd.DataFrame:
    """Collect Horch's indices from the section `horch` of a run of grid own-ground.

    Columns: w_Ti (-), sticky, noise_ratio (-), dtau (-), drho (-), verdict; by w_Ti. It is the
    cotangent of the sampled controller's phase lag, (2 Ti/Ts + 1) tan(w Ts/2): a backward-Euler
    integral leads the continuous one by half a sample.
    """
    scenarios, verdicts = (read_table(run, kind).to_pandas() for kind in ("scenarios", "verdicts"))
    both = scenarios[scenarios.block == "horch"].merge(
        verdicts[verdicts.method == "horch"], on="scenario_id"
    )
    if both.empty:
        raise ParameterError(
            f"{run}: no section 'horch' judged by horch; run grid own-ground with it"
        )
    Ti = np.array([json.loads(loop)["controller"]["Ti"] for loop in both["loop"]])
    indices = [json.loads(text) for text in both.indices]
    both["w_Ti"] = (2 * Ti / both.Ts + 1) * np.tan(np.pi * both.Ts / both.period_s)
    for name in ("dtau", "drho"):
        both[name] = [one.get(name) for one in indices]
    columns = ["w_Ti", "sticky", "noise_ratio", "dtau", "drho", "verdict"]
    return (
        both[columns]
        .dropna()
        .sort_values("w_Ti", ignore_index=True)
        .astype({"dtau": float, "drho": float})
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw dtau over w Ti for both valves, with the law of a linear loop and the bounds of the
    verdict.
    """
    figure, axes = panel(6.4, 4.2)
    x = np.geomspace(data.w_Ti.min(), data.w_Ti.max(), 200)
    axes.plot(
        x,
        2 / np.pi * np.arctan(1 / x),
        color=GREY,
        label="(2/π) atan(1/(ω Ti)), any linear PI loop",
    )
    for sticky, (name, colour, marker) in VALVES.items():
        part = data[data.sticky == sticky]
        axes.plot(part.w_Ti, part.dtau, marker, color=colour, markersize=3.5, alpha=0.6, label=name)
    for verdict, (bound, at) in BOUNDS.items():
        axes.axhline(bound, color=GREY, linewidth=0.8, linestyle="--")
        axes.axvline(at, color=GREY, linewidth=0.8, linestyle=":")
        note(axes, verdict.replace("_", " "), 0.99, 0.95 if verdict == STICTION else 0.06, "right")
    axes.set_xscale("log")
    axes.set_xticks([0.2, 0.5, 1.0, 2.0, 5.0], ["0.2", "0.5", "1", "2", "5"])
    axes.set_xticks([], minor=True)
    axes.set_ylim(0, 1.02)
    axes.legend(loc="lower left", frameon=True, edgecolor="none")
    label(axes, "ω Ti (-)", "Δτ (-)", "Horch's index follows ω Ti, sticky or not")
    return figure

"""Valve families: sensitivity of each method to every friction model, and its false-positive rate
on every healthy valve.

Rows are methods, best first. Columns are valve families in the same cells: left, the share of the
cycling loops that are called sticky; right, the share of the loops that do not cycle and are called
sticky. *: fitted on this grid, +: fitted on a related grid.
"""

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score.families import rates, read
from simbench.bench.score.names import HOME_MARKS
from simbench.bench.score.scoring import home_of
from simbench.bench.store.reading import RunArrays
from simbench.figures._score import SHARE_COLOURS
from simbench.figures._style import panels, styled

SOURCE = "own"
FEWEST = 10  # loops: a share of fewer is not shown


def data(run: str | Path) -> pd.DataFrame:
    """Count verdicts by method and valve family.

    Columns: method, valve, cycling, n, stiction (share) with Wilson's lo and hi, home (where the
    method's constants were fitted); best method first.
    """
    book = RunArrays.read(run)
    counted = rates(read(run))
    counted = counted[counted.n >= FEWEST]
    mean = (
        counted.assign(right=counted.stiction.where(counted.cycling, 1.0 - counted.stiction))
        .groupby(["method", "cycling"])
        .right.mean()
    )
    best = mean.groupby("method").mean().sort_values(ascending=False)
    place = {method: i for i, method in enumerate(best.index)}
    return (
        counted.assign(place=counted.method.map(place))
        .sort_values(["place", "cycling", "valve"], ignore_index=True)
        .drop(columns="place")
        .assign(home=lambda rows: [home_of(method, book) for method in rows.method])
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw both tables of shares as colours, with the numbers written into the cells."""
    methods = list(dict.fromkeys(data.method))
    homes = dict(zip(data.method, data.home, strict=True))
    names = [method + HOME_MARKS[homes[method]] for method in methods]
    sticky, healthy = (sorted(set(data.valve[data.cycling == c])) for c in (True, False))
    figure, (axes,) = panels(
        1, 2, 1.6 + 0.42 * (len(sticky) + len(healthy)), 1.6 + 0.26 * len(methods), sharey=True
    )
    for ax, valves, cycling, title in zip(
        axes,
        (sticky, healthy),
        (True, False),
        ("found, of the cycling loops", "false alarms, of the others"),
        strict=True,
    ):
        part = data[data.cycling == cycling]
        grid = part.pivot(index="method", columns="valve", values="stiction").reindex(
            index=methods, columns=valves
        )
        ax.pcolormesh(grid.to_numpy(), **SHARE_COLOURS)
        for i, row in enumerate(grid.to_numpy()):
            for j, share in enumerate(row):
                if share == share:
                    ax.text(
                        j + 0.5,
                        i + 0.5,
                        f"{share:.2f}"[1:] if share < 1 else "1",
                        ha="center",
                        va="center",
                        fontsize=6,
                        color="w" if share < 0.55 else "k",
                    )
        ax.set_xticks([j + 0.5 for j in range(len(valves))], valves, rotation=60, ha="right")
        ax.set_yticks([i + 0.5 for i in range(len(methods))], names)
        ax.set_title(title)
        ax.set_ylim(len(methods), 0)
    return figure

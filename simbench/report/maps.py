"""Section: where each detector is right, over dead time and stick band."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.figures._style import styled
from simbench.html.svg import inline_svg
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Maps"
MOST = 8  # levels of an axis; more are put into so many groups of like size
AXES = {"Td_over_T": "Td / T", "Td_over_Ti": "Td / Ti"}


def section(run: RunData) -> Markup:
    """Draw one map per detector: share of right verdicts over the ratio of dead time and S/2J.

    Parameters
    ----------
    run : RunData
        The run.

    Returns
    -------
    markupsafe.Markup
    """
    items = []
    for method in run.book.methods:
        mine = run.of(method)
        grids = {name: accuracy_map(mine, axis) for axis, name in AXES.items()}
        grids = {name: grid for name, grid in grids.items() if grid.size}
        if grids:
            says = f"share of right verdicts of {method} over dead time and S/2J"
            items.append({"svg": inline_svg(_draw(method, grids), f"map-{method}", says), "caption": ""})
    return render("maps.html", items=items)


def accuracy_map(judged: pd.DataFrame, axis: str) -> pd.DataFrame:
    """Return the share of right verdicts by one dead-time ratio (rows) and S/2J (columns); empty without both axes.

    Parameters
    ----------
    judged : DataFrame
        From `RunData.of`.
    axis : str
        "Td_over_T" or "Td_over_Ti".

    Returns
    -------
    DataFrame
        NaN where nothing was judged; column 0 is a healthy valve, inf a dead-band.
    """
    here = judged[judged[axis].notna() & judged["S_over_2J"].notna()]
    if here.empty:
        return pd.DataFrame()
    rows, columns = _levels(here[axis]), _levels(here["S_over_2J"])
    return here.assign(_r=rows, _c=columns).pivot_table(index="_r", columns="_c", values="right", aggfunc="mean").sort_index()


def _levels(values: pd.Series) -> pd.Series:
    if values.nunique() <= MOST:
        return values
    finite = values[np.isfinite(values) & (values > 0)]
    edges = np.quantile(finite, np.linspace(0, 1, MOST - 1))
    middle = np.sqrt(edges[1:] * edges[:-1])
    group = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, middle.size - 1)
    # 0 (healthy) and inf (dead-band) keep their own level
    return pd.Series(np.where(np.isfinite(values) & (values > 0), middle[group].round(3), values), index=values.index)


@styled
def _draw(method: str, grids: dict[str, pd.DataFrame]) -> Figure:
    rows = [len(grid) for grid in grids.values()]
    figure = Figure(figsize=(3.5, 0.9 + 0.36 * sum(rows) + 0.55 * len(rows)), layout="constrained")
    axes = figure.subplots(len(grids), 1, squeeze=False, height_ratios=rows)[:, 0]
    for place, (name, grid) in zip(axes, grids.items()):
        shares = grid.to_numpy(dtype=float)
        # one rectangle per cell, no embedded image
        place.pcolormesh(
            np.arange(grid.shape[1] + 1) - 0.5, np.arange(grid.shape[0] + 1) - 0.5, shares, vmin=0, vmax=1, cmap="cividis"
        )
        for i, j in np.ndindex(shares.shape):
            if np.isfinite(shares[i, j]):
                place.text(
                    j,
                    i,
                    f"{100 * shares[i, j]:.0f}",
                    ha="center",
                    va="center",
                    color="white" if shares[i, j] < 0.6 else "#000001",
                )
        place.set_xticks(range(grid.shape[1]), [_level_name(c) for c in grid.columns])
        place.set_yticks(range(grid.shape[0]), [f"{r:.2g}" for r in grid.index])
        place.set_ylabel(name)
        for side in place.spines.values():
            side.set_visible(False)
    axes[-1].set_xlabel("S / 2J (0: healthy valve)")
    axes[0].set_title(f"{method}: right verdicts (%)")
    return figure


def _level_name(value: float) -> str:
    return "dead-\nband" if np.isinf(value) else f"{value:.2g}"

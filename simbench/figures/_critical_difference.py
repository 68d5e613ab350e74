"""Draw the critical difference: mean ranks of the detectors over the scenarios of a run; detectors
whose bars overlap do not differ significantly (Demsar 2006, J. Mach. Learn. Res. 7, 1, figure 1,
with one bar per method).

Detectors that need the valve position MV, and those that apply to only some of the scenarios, are
left out. *: fitted on this grid, +: fitted on loops like these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.bench.score.names import HOME_MARKS
from simbench.detectors.errors import ParameterError
from simbench.figures._style import BLUE, GREY, label, panels, styled

if TYPE_CHECKING:
    from simbench.bench.score.compare import Comparison


def ranks_of(comparison: Comparison) -> pd.DataFrame:
    """Rank the detectors of a comparison.

    Columns: method, mean_rank (1 = best, ties shared), half_width (half the critical difference),
    accuracy, accuracy_lo, accuracy_hi, cases, home (where its constants were fitted).
    """
    if np.isnan(comparison.critical_difference):
        needed = (
            "3 stiction detectors without MV that apply to all scenarios, and 2 scenarios with a"
            " label"
        )
        raise ParameterError(f"mean ranks need at least {needed}")
    ranked = comparison.ranking.dropna(subset=["mean_rank"]).sort_values(
        "mean_rank", ignore_index=True
    )
    ranked.insert(2, "half_width", comparison.critical_difference / 2)
    columns = [
        "method",
        "mean_rank",
        "half_width",
        "accuracy",
        "accuracy_lo",
        "accuracy_hi",
        "cases",
        "home",
    ]
    return ranked.assign(cases=comparison.cases).reindex(columns=columns)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the ranks, and accuracy with its interval next to them."""
    place = -np.arange(len(data))
    figure, ((left, right),) = panels(1, 2, 7.0, 0.9 + 0.24 * len(data), sharey=True)
    left.errorbar(
        data["mean_rank"], place, xerr=data["half_width"], fmt="o", color=BLUE, elinewidth=2.2
    )
    best = data.iloc[0]
    left.axvline(best["mean_rank"] + best["half_width"], color=GREY, linewidth=0.8, linestyle="--")
    label(left, "mean rank, bar = critical difference", "", "bars that overlap: not told apart")
    left.set_yticks(place, data["method"] + data["home"].map(HOME_MARKS))
    reach = [data["accuracy"] - data["accuracy_lo"], data["accuracy_hi"] - data["accuracy"]]
    right.errorbar(data["accuracy"], place, xerr=reach, fmt="o", color=BLUE, elinewidth=1.2)
    label(right, "accuracy against cycled, 95 %", "", f"{int(best['cases'])} scenarios")
    right.set_xlim(0, 1)
    for axes in (left, right):
        axes.grid(axis="x", linewidth=0.4, alpha=0.6)
    return figure

"""Figure 11.14: the variables that Horch's measures are made of, on a cross-correlation that is
neither even nor odd.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._correlation import correlation, draw_correlation
from simbench.figures._marks import note, span
from simbench.page.style import panel, styled

SOURCE = (
    "Jelali (2013), Fig. 11.14 and Eqs 11.6 to 11.8 (absolute bars restored), after Horch (1999)"
)
PERIOD = 60.0  # s
SHIFT = 0.75  # distance of the phase from an even function (rad)


def data() -> pd.DataFrame:
    """Correlate two sinusoids whose phases differ by pi - SHIFT.

    Columns: lag (s), Phi (-), dtau (-), drho (-).
    """
    t = np.arange(0.0, 20 * PERIOD, 0.25)
    return correlation(
        np.sin(2 * np.pi * t / PERIOD), -np.sin(2 * np.pi * t / PERIOD + SHIFT), 0.25, 45.0
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the function with its two zero crossings, its value at lag 0 and its peak."""
    # The function with Horch's points
    figure, axes = panel(5.4, 3.8)
    marks = draw_correlation(axes, data, "")
    peak = float(data["lag (s)"][data["Phi (-)"].idxmin()])

    # The lags of both crossings, and the values at lag 0 and the peak
    span(axes, (-marks.tau_l, 0.12), (0, 0.12), "$τ_l$", (0, 8))
    span(axes, (0, 0.12), (marks.tau_r, 0.12), "$τ_r$", (0, 8))
    axes.plot([peak], [marks.phi_max], "ko")
    axes.annotate("$Φ_0$", (0, marks.phi_0), (12, -4), textcoords="offset points")
    axes.annotate(
        "$Φ_{max}$", (peak, marks.phi_max), (0, -13), textcoords="offset points", ha="center"
    )
    axes.set_ylim(-1.25, 1.5)

    # The two differences
    note(
        axes,
        rf"$Δτ = |τ_l - τ_r|\,/\,(τ_l + τ_r)$ = {marks.dtau:.2f}" + "\n"
        rf"$Δρ = |Φ_0 - Φ_{{max}}|\,/\,|Φ_0 + Φ_{{max}}|$ = {marks.drho:.2f}",
    )
    return figure

"""Figure 11.13: trends and cross-correlation of OP and PV, even without stiction (left), odd with
stiction (right).

Left: a linear loop under an external sine whose controller is slow against it (w Ti = 10). Right: a
sticky flow-like loop.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._correlation import correlation, draw_correlation
from simbench.figures._cycles import sustained_cycle
from simbench.figures._loops import Loops, sine
from simbench.figures._marks import note
from simbench.loop.simulate import simulate
from simbench.page.style import SIGNAL, label, panels, styled

SOURCE = "Jelali (2013), Fig. 11.13, after Horch (1999)"
PERIOD = 100.0  # s, of the sine; about that of the sticky loop's cycle
HEALTHY = {"T": 10.0, "Td": 2.0, "Kc": 0.5, "Ti": 160.0, "Ts": 0.5}
STICKY = {"T": 3.0, "Td": 2.0, "Kc": 0.3, "Ti": 3.0, "Ts": 0.5, "S": 5.0, "J": 2.0}


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate both loops and correlate their second halves.

    Columns: panel, part ("trend" or "correlation"), t (s), OP (%), PV - SP (PV units), lag
    (s), Phi (-), dtau (-), drho (-), and the numbers of the loop.
    """
    # A loop that an outside sine drives
    rows = []
    loops = loops or Loops()
    driven = loops.pi(numbers=HEALTHY, n=4000, disturbance=sine(3.0, PERIOD))
    record = simulate(driven).record.window(2000, 4000)
    numbers = [loops.last]
    healthy = pd.DataFrame(
        {"t (s)": record.t, "OP (%)": record.op, "PV - SP": record.pv - record.sp}
    )

    # A sticky one
    sticky = sustained_cycle(loops.pi(numbers=STICKY, n=4000), periods=12)
    sticky = sticky[["t (s)", "OP (%)", "PV - SP"]]
    numbers = numbers + [loops.last]

    # Trend and correlation of both
    panels_of = (("no stiction", healthy), ("stiction", sticky))
    for (panel, trend), own in zip(panels_of, numbers, strict=True):
        phi = correlation(trend["OP (%)"].to_numpy(), trend["PV - SP"].to_numpy(), record.Ts, 120.0)
        rows += [
            trend.iloc[:800].assign(panel=panel, part="trend", **own),
            phi.assign(panel=panel, part="correlation", **own),
        ]
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw OP and PV above their cross-correlation, for both loops."""
    # Trends above, correlations below
    figure, axes = panels(3, 2, 7.2, 6.0, height_ratios=[1, 1, 1.6])
    for j, (panel, part) in enumerate(data.groupby("panel", sort=False)):
        trend = part[part.part == "trend"]
        for i, (signal, column) in enumerate((("OP", "OP (%)"), ("PV", "PV - SP"))):
            axes[i, j].plot(trend["t (s)"], trend[column], color=SIGNAL[signal])
            label(
                axes[i, j],
                "time (s)",
                {"OP": "OP (%)", "PV": "PV - SP (PV units)"}[signal],
                str(panel) if i == 0 else "",
            )
        marks = draw_correlation(axes[2, j], part[part.part == "correlation"], "")
        note(axes[2, j], str(marks))
        axes[2, j].set_ylim(-1.15, 1.5)
    figure.align_ylabels()
    return figure

"""Figure 11.20: an ellipse fitted to the filtered PV-OP plot, its axes, its limits, and the
apparent stiction along OP.

The loop is simulated: the apparent stiction is a mark of the loop, not the valve's S.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.signal.conditioning import band
from simbench.detectors.signal.ellipse import fit_ellipse
from simbench.figures._cycles import sustained_cycle
from simbench.figures._ellipses import draw_ellipse, ellipse_table
from simbench.figures._loops import Loops
from simbench.figures._marks import note
from simbench.page.style import BLACK, panel, styled

SOURCE = (
    "Jelali (2013), Fig. 11.20 and Eq. 11.15 (square root restored), after Choudhury et al. (2006)"
)
NUMBERS = {"T": 20.0, "Td": 10.0, "Kc": 1.0, "Ti": 20.0, "Ts": 1.0, "S": 5.0, "J": 2.0}


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate four periods, add measurement noise, filter, and fit.

    Columns: curve, OP (%), PV (%), fitness (-), S_apparent (%), and the ellipse's a, b (%) and
    alpha (rad), and the numbers of the loop.
    """
    loops = loops or Loops()
    cycle = sustained_cycle(loops.pi(numbers=NUMBERS), periods=10)
    period = cycle["period (s)"].iloc[0]
    noise = np.random.default_rng(0).normal(0.0, 0.1, (2, len(cycle)))
    op = band(cycle["OP (%)"].to_numpy() + noise[0], period, 3)[: round(4 * period)]
    pv = band(cycle["PV - SP"].to_numpy() + noise[1], period, 3)[: round(4 * period)]
    ellipse = fit_ellipse(op, pv)
    assert ellipse is not None
    a, b, alpha = ellipse.axes
    axes = {"a (%)": a, "b (%)": b, "alpha (rad)": alpha}
    return ellipse_table(op, pv, ellipse).assign(**axes, **loops.last)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the plot with the ellipse's semi-axes and its angle."""
    # Points and ellipse
    figure, place = panel(6.0, 4.4)
    draw_ellipse(place, data, "$OP_f$ - mean (%)", "$PV_f$ - mean (%)")
    a = float(data["a (%)"].iloc[0])
    b = float(data["b (%)"].iloc[0])
    alpha = float(data["alpha (rad)"].iloc[0])
    ring = data[data.curve == "ellipse"]
    x0 = float(ring["OP"].max() + ring["OP"].min()) / 2
    y0 = float(ring["PV"].max() + ring["PV"].min()) / 2

    # Both semi-axes with their names
    for length, angle, name in ((a, alpha, "a"), (b, alpha + np.pi / 2, "b")):
        end = (x0 + length * np.cos(angle), y0 + length * np.sin(angle))
        place.plot([x0, end[0]], [y0, end[1]], color=BLACK, linewidth=1.1)
        at = ((x0 + end[0]) / 2, (y0 + end[1]) / 2)
        place.annotate(name, at, (5, 5), textcoords="offset points", fontweight="bold")

    # The angle of the long one
    place.plot([x0, x0 + 0.5 * a], [y0, y0], color=BLACK, linestyle=":")
    arc = np.linspace(0.0, alpha, 20)
    place.plot(x0 + 0.9 * np.cos(arc), y0 + 0.9 * np.sin(arc), color=BLACK, linewidth=0.8)
    place.annotate(
        "α", (x0 + 1.0, y0 + 0.5 * np.sin(alpha)), (0, 0), textcoords="offset points", va="center"
    )

    # The numbers in words
    place.set_aspect("equal")
    place.set_ylim(-2.4, 2.2)
    place.legend(loc="upper right", ncols=3, markerscale=3)
    S = float(data["S_apparent"].iloc[0])
    fitness = float(data["fitness (-)"].iloc[0])
    own = float(data["S (%)"].iloc[0])
    remark = f"apparent stiction (arrow) {S:.2f} %, the valve's S is {own:g} %\n"
    remark += f"α = {np.degrees(alpha):.0f}°, {fitness:.0%} of the points within ±10 %"
    note(place, remark, 0.02, 0.02, va="bottom")
    return figure

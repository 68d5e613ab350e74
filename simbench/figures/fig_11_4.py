"""Figure 11.4: hysteresis, dead-band, both together, and dead-zone, as a valve's OP-MV plot.

Hysteresis is measured along MV, dead-band and dead-zone along OP; only the dead-zone has no memory.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._marks import note, parts, span
from simbench.loop.response import valve_response
from simbench.page.style import BLUE, GREY, ORANGE, label, panels, styled

SOURCE = "Jelali (2013), Fig. 11.4, redrawn there from ISA-S51.1 (1979)"
# % of travel
S = 20.0  # dead-band
H = 15.0  # hysteresis
D = 30.0  # dead-zone
PANELS = {
    "(a) hysteresis": ("hysteresis", {"S": 0.0, "H": H}),
    "(b) dead-band": ("deadband", {"S": S}),
    "(c) hysteresis + dead-band": ("hysteresis", {"S": S, "H": H}),
    "(d) dead-zone": ("deadzone", {"D": D}),
}


def data() -> pd.DataFrame:
    """Drive four valve models through a full traverse, twice, and an inner loop.

    Columns: panel, model, part ("full traverse" or "inner loop"), OP (%), MV (%).
    """
    # A full traverse, and the way of an inner loop
    full = np.interp(np.arange(801.0), [0, 100, 300, 500, 700, 800], [50, 100, 0, 100, 0, 50])
    inner = np.concatenate(
        [full[:-50], np.linspace(25, 70, 46), np.linspace(70, 35, 36), np.linspace(35, 70, 36)]
    )

    # Every valve on both ways
    rows = []
    for panel, (model, parameters) in PANELS.items():
        for part, op, keep in (
            ("full traverse", full, slice(300, 701)),
            ("inner loop", inner, slice(-72, None)),
        ):
            mv = valve_response(model, op, parameters)
            signals = {"OP (%)": op[keep], "MV (%)": mv[keep]}
            rows.append(pd.DataFrame({"panel": panel, "model": model, "part": part, **signals}))
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the four OP-MV plots."""
    # A full traverse and an inner loop of each valve
    figure, axes = panels(2, 2, 6.4, 6.0, sharex=True, sharey=True)
    for place, panel, part in parts(axes, data, "panel"):
        for name, colour in (("full traverse", BLUE), ("inner loop", ORANGE)):
            curve = part[part.part == name]
            width = 1.6 if colour == BLUE else 1.1
            place.plot(curve["OP (%)"], curve["MV (%)"], color=colour, linewidth=width, label=name)
        place.plot(
            [0, 100], [0, 100], color=GREY, linestyle=":", linewidth=0.9, label="ideal valve"
        )
        label(place, "OP (% of span)", "MV (% of travel)", panel)
        place.set(aspect="equal", xlim=(-2, 102), ylim=(-2, 102))
        place.label_outer()

    # The separation that hysteresis makes
    full = data[data.part == "full traverse"]
    for place, panel in (
        (axes[0, 0], "(a) hysteresis"),
        (axes[1, 0], "(c) hysteresis + dead-band"),
    ):
        low, high = branches(full[full.panel == panel], "OP (%)", 50.0, "MV (%)")
        span(
            place,
            (50, low),
            (50, high),
            f"{high - low:.0f} %",
            (30, -29) if panel[1] == "a" else (18, 24),
        )

    # The widths of dead-band and dead-zone
    low, high = branches(full[full.panel == "(b) dead-band"], "MV (%)", 25.0, "OP (%)")
    span(axes[0, 1], (low, 25), (high, 25), f"S = {high - low:.0f} %", (50, 0))
    span(axes[1, 1], (50 - D / 2, 50), (50 + D / 2, 50), f"D = {D:.0f} %", (0, 9))
    note(axes[0, 0], f"hysteresis\n= separation = {H:.0f} %", 0.98, 0.04, "right", "bottom")
    note(
        axes[1, 0],
        f"hysteresis\n= separation - dead-band\n= {H + S:.0f} - {S:.0f} = {H:.0f} %",
        0.98,
        0.04,
        "right",
        "bottom",
    )

    # Figures that belong to two panels, and the legend
    axes[0, 0].legend(loc="upper left")
    return figure


def branches(loop: pd.DataFrame, along: str, at: float, of: str) -> tuple[float, float]:
    """Return where a loop's two branches stand at one level, lower one first."""
    near = loop[(loop[along] - at).abs() <= 0.01][of]
    return float(near.min()), float(near.max())

"""Figure 11.5: a sticky valve's OP-MV plot with its phases: sticking (dead-band, stick band), slip
jump, motion.

OP rises, pauses at D, rises on to G and falls back: after the pause only the stick band J has to be
overcome, after a reversal the whole width S.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._loops import Loops
from simbench.figures._marks import span, text_near
from simbench.loop.response import valve_response
from simbench.page.style import BLUE, GREY, ORANGE, RED, label, panel, styled

SOURCE = "Jelali (2013), Fig. 11.5, after Choudhury et al. (2005) and Rossi & Scali (2005)"
S = 30.0
J = 10.0
PHASES = {"sticking": RED, "jump": ORANGE, "motion": BLUE}


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Drive Choudhury's valve once up, with a pause, and down.

    Columns: OP (%), MV (%), phase of the step that ends in the sample, and the valve's S and J.
    """
    loops = loops or Loops()
    valve = loops.numbers(S=S, J=J)
    jump = valve["J"] or 0.0
    t = [0, 40, 60, 115, 120, 145, 155, 235, 240, 295]
    corners = [50, 10, 10, 65, 65, 90, 90, 10, 10, 65]
    op = np.interp(np.arange(0.0, 295.25, 0.25), t, corners)
    mv = valve_response("choudhury", op, dict(valve))
    moved = np.diff(mv, prepend=mv[0])
    phase = np.where(np.abs(moved) > jump / 2, "jump", np.where(moved == 0.0, "sticking", "motion"))
    table = pd.DataFrame({"OP (%)": op, "MV (%)": mv, "phase": phase}).assign(**loops.last)
    # from the first reversal (A) to the end of the way down
    return table.iloc[200:961].reset_index(drop=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the OP-MV plot, its phases by colour, and name the points of the chapter."""
    # The valve's way, a colour for each phase
    figure, place = panel(5.6, 5.2)
    place.plot(
        [0, 100], [0, 100], color=GREY, linestyle="-.", linewidth=0.9, label="without stiction"
    )
    op = data["OP (%)"].to_numpy()
    mv = data["MV (%)"].to_numpy()
    start = np.flatnonzero(data.phase.to_numpy()[1:] != data.phase.to_numpy()[:-1]) + 1
    shown = set()
    for a, b in zip(np.append(1, start), np.append(start, len(data))):
        name = str(data.phase[a])
        place.plot(
            op[a - 1 : b],
            mv[a - 1 : b],
            color=PHASES[name],
            linewidth=2.2,
            label=None if name in shown else name,
        )
        shown.add(name)

    # The points that the chapter names
    band = float(data["S (%)"].iloc[0])
    jump = float(data["J (%)"].iloc[0])
    half = (band - jump) / 2
    for name, point, gap in (
        ("A", (10, 10 + half), (-9, 0)),
        ("B", (10 + band, 10 + half), (8, -7)),
        ("C", (10 + band, 10 + half + jump), (-8, 6)),
        ("D", (65, 65 - half), (-8, 6)),
        ("E", (65 + jump, 65 - half), (9, -6)),
        ("F", (65 + jump, 65 - half + jump), (-8, 6)),
        ("G", (90, 90 - half), (9, 0)),
    ):
        place.plot(*point, marker="o", color="black", markersize=4)
        text_near(place, name, point, gap, fontweight="bold")

    # The bands and the jump
    low = 10 + half
    span(place, (10, low - 5), (10 + band - jump, low - 5), "dead-band\nS - J", (0, -13))
    span(place, (10 + band - jump, low - 5), (10 + band, low - 5), "stick\nband J", (4, -13))
    span(place, (10, low - 19), (10 + band, low - 19), "S", (0, -7))
    span(place, (10 + band + 4, low), (10 + band + 4, low + jump), "slip jump J", (32, 0))
    span(place, (65, 65 - half - 5), (65 + jump, 65 - half - 5), "stick\nband J", (0, -13))
    for at, gap in (((80, 70), (26, -8)), ((40, 50), (-62, 6))):
        text_near(place, "moving phase", at, gap, color=BLUE, fontsize=8, ha="left")

    # Legend and axes
    place.legend(loc="upper left", title="phase")
    label(place, "OP (% of span)", "MV (% of travel)")
    place.set_xlim(0, 105)
    place.set_ylim(-6, 100)
    return figure

"""Figure 11.11: qualitative shapes of a sticky valve's OP-MV plot, and what Yamashita's indices
make of them.

(a) IS II and DS DD: the valve catches up along with OP. (b) IS SI and DS SD: it jumps while OP
rests. (c) IS DI and DS ID: the move comes when OP has already turned; rho3 takes it out. The text
does not say which shape its panel (c) holds; ours is what PV of a fast flow loop under PI draws,
the case the chapter calls common in industry and missed by the method.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.methods.yamashita import movement_indices
from simbench.figures._marks import arrow, note, parts, text_near
from simbench.page.style import BLUE, RED, label, panels, styled

SOURCE = "Jelali (2013), Fig. 11.11a to c, after Yamashita (2006) and Manum & Scali (2006)"
# corners (OP, MV) of each loop and the symbol of the side that leaves it
SHAPES = {
    "(a) IS II, DS DD": [((1, 1), "IS"), ((3, 1), "II"), ((5, 3), "DS"), ((3, 3), "DD")],
    "(b) IS SI, DS SD": [((1, 1), "IS"), ((5, 1), "SI"), ((5, 3), "DS"), ((1, 3), "SD")],
    "(c) IS DI, DS ID": [((2, 1), "IS"), ((5, 1), "DI"), ((3, 3), "DS"), ((0, 3), "ID")],
}

# place of each side's name, in points from its middle
ASIDE = {
    "IS": (0, -9),
    "DS": (0, 8),
    "II": (14, -6),
    "DD": (-14, 6),
    "SI": (12, 0),
    "SD": (-13, 0),
    "DI": (13, 7),
    "ID": (-13, -7),
}


def data() -> pd.DataFrame:
    """Walk each shape ten times and compute the indices.

    Columns: panel, OP, MV (no unit), symbol of the side that leaves the corner, rho1 (-), rho2 (-),
    rho3 (-).
    """
    rows = []
    for panel, corners in SHAPES.items():
        places, symbols = zip(*corners)
        op, mv = np.array(places, dtype=float).T
        rho = movement_indices(*walk(op, mv))
        frame = pd.DataFrame({"panel": panel, "OP": op, "MV": mv, "symbol": symbols})
        rows.append(frame.assign(**{f"rho{i + 1} (-)": r for i, r in enumerate(rho)}))
    return pd.concat(rows, ignore_index=True)


def walk(
    op: np.ndarray, mv: np.ndarray, steps: int = 8, rest: int = 24
) -> tuple[np.ndarray, np.ndarray]:
    """Go round a closed path ten times, `steps` samples a side, and rest at every second corner, as
    SS.

    Rests keep the standard deviation of the differences below their size while something moves.
    """
    # Corner by corner, with a rest at every second one
    t = 0
    at = []  # times of the corners
    x = []  # OP
    y = []  # MV
    for k in range(10 * op.size + 1):
        for pause in (0, rest if k % 2 == 0 else 0):
            t += pause
            at = at + [t]
            x = x + [op[k % op.size]]
            y = y + [mv[k % op.size]]
        t += steps

    # Both signals at every sample
    keep = np.concatenate([[True], np.diff(at) > 0])
    sample = np.arange(at[-1] + 1)
    return np.interp(sample, np.array(at)[keep], np.array(x)[keep]), np.interp(
        sample, np.array(at)[keep], np.array(y)[keep]
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the three closed paths, the sticking sides in another colour."""
    # Each side of the path by its symbol
    figure, axes = panels(1, 3, 8.0, 3.0)
    for place, panel, part in parts(axes, data, "panel"):
        corners = part[["OP", "MV"]].to_numpy()
        for i, symbol in enumerate(part["symbol"]):
            start = corners[i]
            end = corners[(i + 1) % len(corners)]
            colour = RED if symbol in ("IS", "DS") else BLUE
            arrow(place, start, end, "->", color=colour, linewidth=2)
            text_near(place, symbol, (start + end) / 2, ASIDE[symbol])

        # The indices that follow from it
        place.set(xlim=(-1.2, 6.4), ylim=(0.2, 4.6), xticks=[], yticks=[])
        label(place, "OP", "MV", str(panel))
        rho1 = part["rho1 (-)"].iloc[0]
        rho3 = part["rho3 (-)"].iloc[0]
        note(place, f"ρ1 = {rho1:.2f}, ρ3 = {rho3:.2f}")
    return figure

"""Figure 11.16: three tunings of e^-s/(3s + 1) without stiction give three kinds of
cross-correlation (Example 11.3).

In a linear PI loop OP answers PV alone, so the phase is fixed by w Ti. The chapter prints the three
verdicts in the order opposite to its Eq. 11.9: phase pi is "no stiction", pi/2 is "stiction".
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.judge import judge
from simbench.figures._correlation import correlation, draw_correlation
from simbench.figures._loops import Loops, sine
from simbench.figures._marks import note, parts
from simbench.loop.simulate import simulate
from simbench.page.style import VERDICT, panels, styled
from simbench.scenarios.spec import Loop

SOURCE = "Jelali (2013), Fig. 11.16 and Example 11.3, verdicts in the order of Eq. 11.9"
PERIOD = 60.0  # s
CASES = {10.0: ("π", 2.0), 1.0: ("3π/4", 1.0), 0.1: ("π/2", 0.15)}  # w Ti: phase shift, Kc


def loop(w_Ti: float, Kc: float, loops: Loops | None = None) -> Loop:
    """Return the healthy loop of one tuning, driven by a sine at the plant's output."""
    numbers = {"T": 3.0, "Td": 1.0, "Kc": Kc, "Ti": w_Ti * PERIOD / (2 * np.pi), "Ts": 0.2}
    return (loops or Loops()).pi(numbers=numbers, n=12000, disturbance=sine(2.0, PERIOD))


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate the three tunings, judge each by Horch's method and correlate its last 20 periods.

    Columns: w_Ti, verdict, lag (s), Phi (-), dtau (-), drho (-), and the numbers of the loop.
    """
    rows = []
    loops = loops or Loops()
    for w_Ti, (_, Kc) in CASES.items():
        record = simulate(loop(w_Ti, Kc, loops)).record.window(6000, 12000)
        verdict = judge(record, ["horch"])[0].verdict
        rows.append(
            correlation(record.op, record.pv, record.Ts, 75.0).assign(
                w_Ti=w_Ti, verdict=verdict, **loops.last
            )
        )
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the three cross-correlations with their verdicts."""
    figure, axes = panels(1, 3, 8.4, 3.1, sharey=True)
    for place, w_Ti, part in parts(axes, data, "w_Ti"):
        marks = draw_correlation(
            place, part, f"phase shift {CASES[float(str(w_Ti))][0]}  ($ωT_i$ = {w_Ti:g})"
        )
        note(
            place,
            f"{marks}\nHorch: {VERDICT[part.verdict.iloc[0]]}",
        )
        place.set_ylim(-1.15, 1.7)
        place.label_outer()
    return figure

"""Figure 11.26: valve travel test: small steps of OP in manual until PV moves, in the same
direction and reversed.

In the same direction, as the procedure prints it, the sum of the steps is the slip jump J; against
it, the whole band S.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.confirm.travel import travel_test
from simbench.figures._loops import Loops
from simbench.figures._marks import note, room
from simbench.page.style import GREY, SIGNAL, label, panels, styled
from simbench.scenarios.spec import Loop

SOURCE = "Jelali (2013), Fig. 11.26 and Procedure 11.4, after Gerry & Ruel (2001)"
NUMBERS = {"T": 5.0, "Td": 1.0, "Kc": 0.5, "Ti": 5.0, "Ts": 1.0, "S": 3.0, "J": 1.1}


def loop(loops: Loops | None = None) -> Loop:
    """Return the flow loop."""
    return (loops or Loops()).pi(numbers=NUMBERS, noise={"std": 0.02})


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Run the test on a simulated flow loop.

    Columns: t (s), OP (%), MV (%), PV (%), phase (0 big steps, 1 same direction, 2 reversed), S
    measured (%), J measured (%), and the numbers of the loop.
    """
    # The test, sample by sample
    loops = loops or Loops()
    result = travel_test(loop(loops))
    trace = result.trace
    t = np.arange(trace.op.size) * result.Ts
    table = pd.DataFrame(
        {
            "t (s)": t,
            "OP (%)": trace.op,
            "MV (%)": trace.mv,
            "PV (%)": trace.pv,
            "phase": result.phase,
        }
    )

    # What it measured
    measured = {"S measured (%)": result.S, "J measured (%)": result.J}
    return table.assign(**measured, **loops.last)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw OP and PV with the two bands marked."""
    # OP and PV, with the ends of both parts
    figure, axes = panels(2, 1, 7.2, 4.8, sharex=True)
    t = data["t (s)"]
    for place, name in ((axes[0, 0], "OP"), (axes[1, 0], "PV")):
        place.plot(t, data[f"{name} (%)"], color=SIGNAL[name], linewidth=1.0)
        room(place, data[f"{name} (%)"], 0.08, 0.3)
        label(place, "time (s)", f"{name} (%)")
        place.label_outer()
        for phase in (1, 2):
            place.axvline(
                t[data["phase"] == phase].iloc[0], color=GREY, linestyle="--", linewidth=0.9
            )

    # What each part measures
    remarks = (
        "big steps",
        f"same direction:\nJ = {data['J measured (%)'].iloc[0]:.1f} %",
        f"reversed:\nS = {data['S measured (%)'].iloc[0]:.1f} %",
    )
    for phase, text in enumerate(remarks):
        part = t[data["phase"] == phase]
        x = (part.mean() - axes[0, 0].get_xlim()[0]) / np.ptp(axes[0, 0].get_xlim())
        note(axes[0, 0], text, float(x), 0.99, "center")
    return figure

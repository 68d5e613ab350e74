"""Draw a change of controller gain: OP and PV before and after, with both periods."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.confirm.gain_change import gain_change
from simbench.figures._marks import note, room
from simbench.page.style import GREY, SIGNAL, label, panels, styled
from simbench.scenarios.spec import Loop

_SHOWN = 5.5  # periods on either side of the change


def gain_table(loop: Loop, factor: float, numbers: Mapping[str, float]) -> pd.DataFrame:
    """Run the gain-change test and keep some periods around the change, with the loop's numbers;
    Kc is that of each side.
    """
    result = gain_change(loop, factor)
    t = (np.arange(result.trace.op.size) - result.changed) * result.Ts
    rows = []
    for phase, chosen in ((result.before, t < 0), (result.after, t >= 0)):
        near = chosen & (np.abs(t) <= _SHOWN * phase.period)
        signals = {
            "t (s)": t[near],
            "OP (%)": result.trace.op[near],
            "PV - SP": result.trace.pv[near] - loop.setpoint.value,
        }
        # half peak-to-peak, without the transient right after the change
        amplitude = np.ptp(result.trace.op[chosen][-round(5 * phase.period / result.Ts) :]) / 2
        rows.append(
            pd.DataFrame(signals).assign(
                **{**numbers, "Kc": phase.Kc},
                **{"period (s)": phase.period, "amplitude (%)": amplitude},
            )
        )
    return pd.concat(rows, ignore_index=True).assign(verdict=result.verdict)


@styled
def draw_gain(data: pd.DataFrame) -> Figure:
    """Draw OP and PV over time, with gain and period on either side."""
    # OP and PV over time
    figure, axes = panels(2, 1, 7.2, 4.2, sharex=True)
    for place, name, unit in (
        (axes[0, 0], "OP", "OP (%)"),
        (axes[1, 0], "PV", "PV - SP (PV units)"),
    ):
        if name == "OP":
            values = data["OP (%)"]
        else:
            values = data["PV - SP"]
        place.plot(data["t (s)"], values, color=SIGNAL[name])
        place.axvline(0, color=GREY, linestyle="--", linewidth=0.9)
        room(place, values, 0.06, 0.34 if name == "OP" else 0.06)
        label(place, "time from the change of gain (s)", unit)
        place.label_outer()

    # Gain, period and amplitude of each part
    for Kc, part in data.groupby("Kc", sort=False):
        low, high = axes[0, 0].get_xlim()
        middle = (part["t (s)"].mean() - low) / (high - low)
        period = part["period (s)"].iloc[0]
        amplitude = part["amplitude (%)"].iloc[0]
        note(
            axes[0, 0],
            f"Kc = {Kc:g}: period {period:.3g} s, OP ±{amplitude:.2g} %",
            middle,
            0.99,
            "center",
        )
    return figure

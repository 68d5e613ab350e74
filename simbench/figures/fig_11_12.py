"""Figure 11.12: time trends and PV-OP plot of flow loop PAP2, with Yamashita's indices (needs
ISDB).
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.methods.yamashita import movement_indices
from simbench.figures._marks import mosaic, note
from simbench.figures._records import real_loop
from simbench.page.style import BLUE, SIGNAL, label, styled

SOURCE = (
    "Jelali (2013), Fig. 11.12 and Example 11.1 (rho1 = 0.48, rho3 = 0.41); data: ISDB loop PAP2"
)


def data(isdb: str) -> pd.DataFrame:
    """Read PAP2 and compute its indices.

    Columns: t (s), OP (%), PV (record's units), rho1 (-), rho3 (-).
    """
    record = real_loop(isdb, "PAP2", kind="flow", process="self-regulating")
    rho1, _, rho3 = movement_indices(record.op, record.pv)
    return pd.DataFrame(
        {
            "t (s)": record.t,
            "OP (%)": record.op,
            "PV": record.pv,
            "rho1 (-)": rho1,
            "rho3 (-)": rho3,
        }
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw both trends and the PV-OP plot."""
    # Both trends
    figure, axes = mosaic([["op", "xy"], ["pv", "xy"]], 7.4, 3.8, width_ratios=[1.5, 1])
    for name, column, unit in (("op", "OP (%)", "OP (%)"), ("pv", "PV", "PV (record's units)")):
        axes[name].plot(data["t (s)"], data[column], color=SIGNAL[name.upper()], linewidth=0.8)
        label(axes[name], "time (s)", unit)

    # PV over OP, with both indices
    axes["xy"].plot(
        data["OP (%)"], data["PV"], color=BLUE, linewidth=0.4, marker=".", markersize=1.5
    )
    label(axes["xy"], "OP (%)", "PV (record's units)", "PV-OP plot")
    rho1 = data["rho1 (-)"].iloc[0]
    rho3 = data["rho3 (-)"].iloc[0]
    note(
        axes["xy"], f"ρ1 = {rho1:.2f}, ρ3 = {rho3:.2f}\n(printed: 0.48, 0.41)", 0.97, 0.98, "right"
    )
    return figure

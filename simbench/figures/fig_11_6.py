"""Figure 11.6: PV-OP plots of four industrial flow loops with stiction (needs ISDB).

Unlike Fig. 11.5 the plots are distorted by process, controller and disturbances. The chapter does
not name its four loops; the first four of ours that are there are drawn.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._marks import parts
from simbench.figures._records import NeedsRecord, real_loop
from simbench.page.style import BLUE, label, panels, styled

SOURCE = "Jelali (2013), Fig. 11.6; data: ISDB (Jelali & Huang 2010), StictionGPT"
LOOPS = (
    "CHEM1", "CHEM23", "PAP2", "CHEM11", "CHEM12", "CHEM18", "CHEM5", "PAP1",
    "SGPT_2411FIC20102_0609-0957", "SGPT_2-CDU-7040-311-FIC31102_0628-0002",
)  # fmt: skip


def data(isdb: str) -> pd.DataFrame:
    """Read four sticky flow loops.

    Columns: loop, t (s), OP, PV (both in the record's units).
    """
    # The first four that are there
    rows = []
    for name in LOOPS:
        try:
            record = real_loop(isdb, name, kind="flow", process="self-regulating")
        except NeedsRecord:
            continue
        rows.append(
            pd.DataFrame({"loop": name, "t (s)": record.t, "OP": record.op, "PV": record.pv})
        )
        if len(rows) == 4:
            return pd.concat(rows, ignore_index=True)

    # Fewer than four make no figure
    raise NeedsRecord(
        f"needs four sticky flow loops of ISDB ({', '.join(LOOPS[:6])}, ...); {isdb} holds"
        f" {len(rows)}"
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the four PV-OP plots."""
    figure, axes = panels(2, 2, 6.4, 5.6)
    for place, name, part in parts(axes, data, "loop"):
        place.plot(part["OP"], part["PV"], color=BLUE, linewidth=0.5, marker=".", markersize=1.5)
        label(place, "OP (record's units)", "PV (record's units)", str(name))
    return figure

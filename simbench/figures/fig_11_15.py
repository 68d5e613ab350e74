"""Figure 11.15: cross-correlation of loops CHEM1 (stiction) and PAP4 (no stiction) (needs ISDB)."""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._correlation import correlation, draw_correlation
from simbench.figures._marks import note, parts
from simbench.figures._records import filter_record, real_loop
from simbench.page.style import panels, styled

SOURCE = "Jelali (2013), Fig. 11.15 and Example 11.2; data: ISDB loops CHEM1, PAP4"
PRINTED = {"CHEM1": (0.73, 0.40), "PAP4": (0.13, 0.0)}


def data(isdb: str) -> pd.DataFrame:
    """Correlate OP and PV of both loops, conditioned as the detector does.

    Columns: loop, lag (s), Phi (-), dtau (-), drho (-).
    """
    rows = []
    for name in PRINTED:
        record = real_loop(isdb, name, process="self-regulating")
        op, pv, period = filter_record(record)
        rows.append(correlation(op, pv, record.Ts, 2 * period * record.Ts).assign(loop=name))
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw both functions with their indices and the printed ones."""
    figure, axes = panels(1, 2, 7.2, 3.2)
    for place, name, part in parts(axes, data, "loop"):
        marks = draw_correlation(place, part, str(name))
        printed = PRINTED[str(name)]
        note(
            place,
            f"{marks}\n(printed: {printed[0]:.2f}, {printed[1]:.2f})",
        )
        place.set_ylim(-1.15, 1.7)
    return figure

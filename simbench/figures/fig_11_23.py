"""Figure 11.23: ellipse fitted to level loop POW2 with its 10 % limits and the share of points
between them (needs ISDB).
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.signal.ellipse import fit_ellipse
from simbench.figures._ellipses import draw_ellipse, ellipse_table
from simbench.figures._marks import note
from simbench.figures._records import NeedsRecord, filter_record, real_loop
from simbench.page.style import panel, styled

SOURCE = "Jelali (2013), Fig. 11.23 and Example 11.6 (fitness 93.5 %); data: ISDB loop POW2"


def data(isdb: str) -> pd.DataFrame:
    """Filter the first 1000 samples of POW2 and fit an ellipse.

    Columns: curve, OP, PV (record's units), fitness (-), S_apparent (units of OP).
    """
    record = real_loop(isdb, "POW2", kind="level")
    record = record.window(0, min(1000, record.n))
    op, pv, _ = filter_record(record)
    ellipse = fit_ellipse(op, pv)
    if ellipse is None:
        raise NeedsRecord("needs ISDB loop POW2; no ellipse can be fitted to the one given")
    return ellipse_table(op, pv, ellipse)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw points, ellipse and limits."""
    # Points and ellipse of POW2
    figure, place = panel(5.6, 4.4)
    draw_ellipse(
        place, data, "$OP_f$ - drift (record's units)", "$PV_f$ - drift (record's units)", "POW2"
    )
    place.legend(loc="upper right", markerscale=3)

    # The numbers beside the printed ones
    fitness = float(data["fitness (-)"].iloc[0])
    S = float(data["S_apparent"].iloc[0])
    note(
        place,
        f"{fitness:.1%} within ±10 % (printed: 93.5 %)\napparent stiction {S:.2g}",
        0.02,
        0.02,
        va="bottom",
    )
    return figure

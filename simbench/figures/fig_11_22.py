"""Figure 11.22: the same views of CHEM30 after filtering, with the fitted ellipse and the apparent
stiction (needs ISDB).
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.signal.oscillation import regular_segment
from simbench.figures._nonlinearity import draw_nonlinearity, nonlinearity
from simbench.figures._records import filter_record, real_loop
from simbench.page.style import styled

SOURCE = (
    "Jelali (2013), Fig. 11.22 and Example 11.5 (apparent stiction 0.43 %); data: ISDB loop CHEM30"
)


def data(isdb: str) -> pd.DataFrame:
    """Filter CHEM30 around its oscillation and compute bicoherence and ellipse of its most regular
    stretch.
    """
    record = real_loop(isdb, "CHEM30", kind="flow")
    op, pv, period = filter_record(record)
    start, stop = regular_segment(op, period, min(1000, record.n))
    return nonlinearity(record.window(start, stop), op[start:stop], pv[start:stop])


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw error, bicoherence and PV-OP plot with its ellipse."""
    return draw_nonlinearity(data, ellipse=True, printed="(printed: 0.04, 0.57)")

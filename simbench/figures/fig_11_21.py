"""Figure 11.21: nonlinearity indices and PV-OP plot of flow loop CHEM30 without filtering (needs
ISDB).
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._nonlinearity import draw_nonlinearity, nonlinearity
from simbench.figures._records import real_loop
from simbench.page.style import styled

SOURCE = "Jelali (2013), Fig. 11.21 and Example 11.5; data: ISDB loop CHEM30"


def data(isdb: str) -> pd.DataFrame:
    """Read CHEM30 and compute its bicoherence as it is."""
    record = real_loop(isdb, "CHEM30", kind="flow")
    return nonlinearity(record, record.op, record.pv)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw error, bicoherence and PV-OP plot."""
    return draw_nonlinearity(data, ellipse=False, printed="(printed: 0.03, 0.58)")

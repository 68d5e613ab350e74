"""Table 11.4: the symbols of an OP-MV plot; the sticky ones, IS and DS, are framed."""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._marks import table
from simbench.page.style import styled

SOURCE = "Jelali (2013), Table 11.4, after Yamashita (2006)"


def data() -> pd.DataFrame:
    """Combine OP's symbol and MV's.

    One row per OP symbol, one column per MV symbol; D decreasing, S steady, I increasing.
    """
    return pd.DataFrame(
        [([op] + [op + mv for mv in "DSI"]) for op in "ISD"], columns=["OP / MV", "D", "S", "I"]
    )


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the table."""
    foot = (
        "First letter: OP, second: MV (valve position). SS is skipped. In IS and DS the valve"
        " stands still while OP moves."
    )
    return table(data, [12, 10, 10, 10], framed={(0, 2), (2, 2)}, foot=foot)

"""Figure 11.24: a lower controller gain makes a stiction cycle slower and leaves its amplitude."""

from __future__ import annotations

import pandas as pd

from scenarios.spec import Loop
from simbench.figures._gain import draw_gain, gain_table

SOURCE = "Jelali (2013), Fig. 11.24 and Sect. 11.8.1, after Choudhury et al. (2005)"
draw = draw_gain
LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
    "valve": {"model": "choudhury", "S": 5.0, "J": 2.0},
    "sampling": {"Ts": 1.0, "n": 1500},
}


def data() -> pd.DataFrame:
    """Lower Kc from 1 to 0.6 in a sticky loop."""
    return gain_table(Loop.from_table(LOOP), 0.6)

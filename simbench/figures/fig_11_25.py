"""Figure 11.25: a lower controller gain leaves the period of an oscillation that comes from
outside.

The same loop as in Fig. 11.24, but the valve is ideal and a sine of 60 s acts on PV.
"""

from __future__ import annotations

import pandas as pd

from scenarios.spec import Loop
from simbench.figures._gain import draw_gain, gain_table

SOURCE = "Jelali (2013), Fig. 11.25 and Sect. 11.8.1"
draw = draw_gain
LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "disturbance": [{"type": "sine", "amplitude": 2.0, "period": 60.0, "at": "output"}],
}


def data() -> pd.DataFrame:
    """Lower Kc from 1 to 0.6 in a healthy loop under an external sine."""
    return gain_table(Loop.from_table(LOOP), 0.6)

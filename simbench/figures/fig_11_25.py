"""Figure 11.25: a lower controller gain leaves the period of an oscillation that comes from
outside.

The same loop as in Fig. 11.24, but the valve is ideal and a sine of 60 s acts on PV.
"""

import pandas as pd

from simbench.figures._gain import draw_gain, gain_table
from simbench.figures._loops import Loops, sine

SOURCE = "Jelali (2013), Fig. 11.25 and Sect. 11.8.1"
draw = draw_gain
NUMBERS = {"T": 10.0, "Td": 2.0, "Kc": 1.0, "Ti": 10.0, "Ts": 1.0}


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Lower Kc from 1 to 0.6 in a healthy loop under an external sine."""
    loops = loops or Loops()
    driven = loops.pi(numbers=NUMBERS, n=1500, disturbance=sine(2.0, 60.0))
    return gain_table(driven, 0.6, loops.last)

"""Figure 11.24: a lower controller gain makes a stiction cycle slower and leaves its amplitude."""

import pandas as pd

from simbench.figures._gain import draw_gain, gain_table
from simbench.figures._loops import Loops

SOURCE = "Jelali (2013), Fig. 11.24 and Sect. 11.8.1, after Choudhury et al. (2005)"
draw = draw_gain
NUMBERS = {"T": 10.0, "Td": 2.0, "Kc": 1.0, "Ti": 10.0, "Ts": 1.0, "S": 5.0, "J": 2.0}


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Lower Kc from 1 to 0.6 in a sticky loop."""
    loops = loops or Loops()
    return gain_table(loops.pi(numbers=NUMBERS, n=1500), 0.6, loops.last)

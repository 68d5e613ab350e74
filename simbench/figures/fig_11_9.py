"""Figure 11.9: OP, MV, PV and their plots against each other in a sticky self-regulating loop, over
Td/T and over S/2J.

PV turns from a square through a sine to a triangle as Td/T or S/2J falls; OP stays a triangle and
MV keeps its jumps.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._cycles import draw_cycles, panel_cycles
from simbench.figures._loops import Loops
from simbench.page.style import styled
from simbench.scenarios.spec import Loop

SOURCE = "Jelali (2013), Fig. 11.9a and b (Ts = 2; S = 5), after Rossi & Scali (2005)"
Ts = 2.0
S = 5.0
Td = 20.0
K = 1.0
PANELS = [
    ("a", 5.0, 1.25),
    ("a", 0.5, 1.25),
    ("a", 0.05, 1.25),
    ("b", 0.15, 12.5),
    ("b", 0.15, 2.5),
    ("b", 0.15, 0.5),
]


def loop(Td_over_T: float, S_over_2J: float, loops: Loops | None = None) -> Loop:
    """Return the loop of one panel: FOPTD, PI with Ti = T and half the gain at which Kc K Td / T =
    1.
    """
    T = Td / Td_over_T
    numbers = {"K": K, "T": T, "Td": Td, "Kc": 0.5 * T / (K * Td), "Ti": T, "Ts": Ts}
    numbers |= {"S": S, "J": S / (2 * S_over_2J)}
    return (loops or Loops()).pi(numbers=numbers, n=4000)


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate six loops until they cycle and keep three periods.

    Columns: panel, Td_over_T, S_over_2J, period (s), t (s), OP (%), MV (%), PV - SP (%
    as K = 1), and the numbers of the loop.
    """
    return panel_cycles(PANELS, "Td_over_T", loop, loops or Loops())


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw five rows (OP, MV, PV, MV-OP, PV-OP) by six loops."""
    return draw_cycles(data, "Td_over_T", "$T_d/T$", "PV - SP (%)")

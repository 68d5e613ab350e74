"""Figure 11.9, integrating: the same five views for an integrating process under PI, over Td/Ti and
over S/2J.

Here PV is the triangle (the square MV integrated once) and OP, which integrates it again, is
rounded.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._cycles import draw_cycles, panel_cycles
from simbench.figures._loops import Loops
from simbench.page.style import styled
from simbench.scenarios.spec import Loop

SOURCE = (
    "Jelali (2013), Sect. 11.3.4: 'similar analysis can be carried out for integrating processes';"
    " not drawn there"
)
Ts = 2.0
S = 5.0
Td = 20.0
K = 0.01
PANELS = [
    ("a", 0.2, 1.25),
    ("a", 0.1, 1.25),
    ("a", 0.05, 1.25),
    ("b", 0.1, 12.5),
    ("b", 0.1, 2.5),
    ("b", 0.1, 0.5),
]


def loop(Td_over_Ti: float, S_over_2J: float, loops: Loops | None = None) -> Loop:
    """Return the loop of one panel: K e^(-Td s)/s with Kc K Td = 0.3."""
    numbers = {"K": K, "Td": Td, "Kc": 0.3 / (K * Td), "Ti": Td / Td_over_Ti, "Ts": Ts}
    numbers |= {"S": S, "J": S / (2 * S_over_2J)}
    return (loops or Loops()).pi(numbers=numbers, n=4000)


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate six loops until they cycle and keep three periods.

    Columns: panel, Td_over_Ti, S_over_2J, period (s), t (s), OP (%), MV (%), PV - SP (PV
    units), and the numbers of the loop.
    """
    return panel_cycles(PANELS, "Td_over_Ti", loop, loops or Loops())


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw five rows (OP, MV, PV, MV-OP, PV-OP) by six loops."""
    return draw_cycles(data, "Td_over_Ti", "$T_d/T_i$", "PV - SP (PV units)")

"""Figure 11.1: a control loop with a control valve, and the names that signals have here.

The valve translates controller output OP into its position MV; friction makes the two differ.
"""

import pandas as pd

from simbench.figures._sketch import arrow, box, draw_sketch, sketch, words

SOURCE = "own drawing after Jelali (2013), Fig. 11.1"
draw = draw_sketch


def data() -> pd.DataFrame:
    """Lay out the block diagram.

    Columns: shape, part, x, y, text.
    """
    return sketch(
        arrow([(-1.6, 0), (-0.45, 0)], "SP"),
        box(-0.2, 0, "-"),
        arrow([(0.05, 0), (1.0, 0)], "e"),
        box(1.75, 0, "controller"),
        arrow([(2.5, 0), (3.6, 0)], "OP"),
        box(4.2, 0, "valve"),
        arrow([(4.8, 0), (5.8, 0)], "MV"),
        box(6.5, 0, "process"),
        arrow([(7.2, 0), (9.2, 0)], "PV"),
        arrow([(8.4, 0), (8.4, -1.4), (-0.2, -1.4), (-0.2, -0.4)]),
        arrow([(6.5, 1.3), (6.5, 0.4)], "load", (6.95, 1.1)),
        arrow([(4.2, 1.3), (4.2, 0.4)], "friction", (4.85, 1.1)),
        words(3.4, -1.15, "measured, with noise"),
    )

"""Figure 11.2: a level loop, the example of a loop with a valve: the controller moves the outflow
until the level is right.

Without outflow control the level integrates: it is the process of the integrating loops here.
"""

import pandas as pd

from simbench.figures._sketch import arrow, box, draw_sketch, line, sketch, words

SOURCE = "own drawing after Jelali (2013), Fig. 11.2"
draw = draw_sketch


def data() -> pd.DataFrame:
    """Lay out tank, transmitter, controller and valve.

    Columns: shape, part, x, y, text.
    """
    return sketch(
        arrow([(-1.4, 2.6), (0.6, 2.6), (0.6, 1.9)], "inflow (load)", (-0.5, 2.8)),
        line([(0.2, 2.2), (0.2, 0), (2.6, 0), (2.6, 2.2)]),
        line([(0.2, 1.4), (2.6, 1.4)], "level", (1.4, 1.2)),
        line([(2.6, 1.0), (3.3, 1.0)]),
        box(3.6, 1.0, "LT"),
        arrow([(3.6, 1.35), (3.6, 2.3)], "PV", (3.85, 1.8)),
        box(3.6, 2.6, "LC"),
        arrow([(5.0, 2.6), (3.95, 2.6)], "SP", (4.6, 2.8)),
        arrow([(3.6, 2.9), (3.6, 3.3), (5.6, 3.3), (5.6, 0.35)], "OP", (5.85, 1.9)),
        line([(2.6, 0.15), (5.2, 0.15)]),
        line([(5.2, 0.4), (6.0, -0.1), (6.0, 0.4), (5.2, -0.1), (5.2, 0.4)]),
        arrow([(6.0, 0.15), (7.4, 0.15)], "outflow, set by MV", (7.0, 0.4)),
        words(5.6, -0.4, "valve"),
    )

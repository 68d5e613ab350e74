"""Figure 11.3: a pneumatic control valve, and where it sticks.

Air lifts the diaphragm against a spring; the stem carries the plug through the packing, whose
friction is the stiction.
"""

import pandas as pd

from simbench.figures._sketch import arrow, draw_sketch, line, sketch, words

SOURCE = "own drawing after Jelali (2013), Fig. 11.3"
draw = draw_sketch


def data() -> pd.DataFrame:
    """Lay out actuator, stem, packing, plug and seat.

    Columns: shape, part, x, y, text.
    """
    spring = [(-0.25 if k % 2 else 0.25, 3.45 + 0.12 * k) for k in range(8)]
    return sketch(
        line([(-1.4, 3.3), (-1.4, 4.4), (1.4, 4.4), (1.4, 3.3)]),
        line([(-1.4, 3.3), (-1.4, 2.6), (1.4, 2.6), (1.4, 3.3)]),
        line([(-1.4, 3.4), (-0.9, 3.3), (0.9, 3.3), (1.4, 3.4)]),
        words(2.2, 3.35, "diaphragm"),
        line(spring),
        words(2.0, 4.0, "spring"),
        arrow([(-2.8, 2.9), (-1.45, 2.9)], "air, set by OP", (-2.5, 3.1)),
        line([(0, 3.3), (0, 0.55)]),
        words(0.75, 2.3, "stem, at MV"),
        line([(-0.45, 1.9), (-0.1, 1.9), (-0.1, 1.4), (-0.45, 1.4), (-0.45, 1.9)]),
        line([(0.45, 1.9), (0.1, 1.9), (0.1, 1.4), (0.45, 1.4), (0.45, 1.9)]),
        words(1.75, 1.65, "packing: friction"),
        line([(-0.45, 0.55), (0.45, 0.55), (0.15, 0.1), (-0.15, 0.1), (-0.45, 0.55)]),
        words(0.85, 0.35, "plug"),
        line([(-2.2, 0.0), (-0.3, 0.0)]),
        line([(0.3, 0.0), (2.2, 0.0)]),
        words(1.5, 0.15, "seat"),
        line([(-2.2, 1.0), (-0.6, 1.0), (-0.6, 1.3)]),
        line([(2.2, 1.0), (0.6, 1.0), (0.6, 1.3)]),
        line([(-2.2, -1.0), (2.2, -1.0)]),
        arrow([(-2.6, 0.6), (-1.2, 0.6)], "flow", (-2.0, 0.8)),
        arrow([(1.0, -0.5), (2.8, -0.5)]),
    )

"""Figure 11.19: Procedure 11.3, the way of `choudhury` through a record, with the bounds that the
program holds.

First a nonlinearity in the control error, by bicoherence or by surrogates, then an ellipse of
filtered PV over filtered OP.
"""

import pandas as pd

from simbench.detectors.methods.choudhury import METHOD
from simbench.detectors.signal.bicoherence import BESIDE, LOWEST
from simbench.figures._sketch import arrow, box, draw_sketch, sketch

SOURCE = (
    "own drawing after Jelali (2013), Fig. 11.19 and Procedure 11.3; detectors/methods/choudhury.py"
)
draw = draw_sketch


def data() -> pd.DataFrame:
    """Lay out the procedure from the bounds of the method.

    Columns: shape, part, x, y, text.
    """
    bounds = METHOD.defaults()
    return sketch(
        box(0, 0, "control error e = SP - PV"),
        arrow([(0, -0.35), (0, -1.0)]),
        box(
            0,
            -1.5,
            f"bicoherence: NGI > {bounds['ngi_low']:g} and NLI > {bounds['nli_low']:g}\nor"
            " surrogates: NPI > 1",
        ),
        arrow([(2.6, -1.5), (4.1, -1.5)], "no"),
        box(5.9, -1.5, "linear: tuning or\nan outside oscillation"),
        arrow([(0, -2.05), (0, -2.8)], "yes", (0.3, -2.4)),
        box(
            0,
            -3.3,
            f"zero-phase band-pass of OP and PV:\nmax({LOWEST}, f - {BESIDE}) to min(0.5, f +"
            f" {BESIDE}) per sample",
        ),
        arrow([(0, -3.85), (0, -4.5)]),
        box(0, -4.9, "the four most regular cycles"),
        arrow([(0, -5.25), (0, -5.9)]),
        box(0, -6.4, f"ellipse of PV over OP:\nfitness of at least {bounds['fitness_low']:g}"),
        arrow([(1.9, -6.4), (4.1, -6.4)], "no"),
        box(5.9, -6.4, "another valve problem"),
        arrow([(0, -6.95), (0, -7.7)], "yes", (0.3, -7.3)),
        box(0, -8.2, "stiction;\napparent stiction = chord along OP"),
    )

"""Table 11.1: ideal and acceptable values of a valve's parameters, and three simulated valves
measured against them.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.confirm.grade import grade
from simbench.figures._loops import pi_loop
from simbench.figures._marks import table
from simbench.page.style import styled

SOURCE = (
    "Jelali (2013), Table 11.1, after Ruel (2000); limits of the process gain 0.5 and 3, as far as"
    " the text keeps them"
)
VALVES = {
    "good valve": ("choudhury", {"S": 0.4, "J": 0.2}, 1.2, 0.05),
    "worn linkage": ("hysteresis", {"S": 0.5, "H": 4.5}, 0.8, 0.05),
    "sticky, oversized": ("choudhury", {"S": 3.0, "J": 1.1}, 3.6, 0.1),
}


def data() -> pd.DataFrame:
    """Measure three valves as an engineer would: in manual, by steps.

    Columns: parameter, ideal, practical, and per valve the measured value and whether it is
    acceptable (NAME: ok).
    """
    # Three valves on one loop
    graded = {}
    for name, (model, parameters, K, noise) in VALVES.items():
        valve = {"model": model, **parameters}
        loop = pi_loop(
            K=K, T=5.0, Td=1.0, Kc=0.3, Ti=5.0, Ts=1.0, valve=valve, noise={"std": noise}
        )
        graded[name] = grade(loop)

    # A row for every measure, a column for every valve
    first = next(iter(graded.values()))
    frame = pd.DataFrame(
        [[g.parameter, g.ideal, g.practical] for g in first],
        columns=["parameter", "ideal", "practical"],
    )
    for name, grades in graded.items():
        frame[name] = [g.value for g in grades]
        frame[f"{name}: ok"] = [g.acceptable for g in grades]
    return frame


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the table; what is to be checked is framed."""
    shown = data[["parameter", "ideal", "practical"]].copy()
    framed = set()
    for j, name in enumerate(VALVES):
        shown[name] = [f"{x:.2g}" for x in data[name]]
        framed |= {(i, 3 + j) for i, ok in enumerate(data[f"{name}: ok"]) if not ok}
    foot = (
        "Measured on simulated loops in manual: stiction by the travel test in the same direction"
        " (+0/-0.2 %), hysteresis over a full traverse less the dead-band. Framed: to be checked."
    )
    return table(shown, [19, 6, 34, 12, 13, 18], framed=framed, foot=foot)

"""Table 11.1: ideal and acceptable values of a valve's parameters, and three simulated valves measured against them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from scenarios.spec import Loop
from simbench.confirm.travel import travel_test
from simbench.figures._style import styled, table
from simbench.loop.response import valve_response

SOURCE = "Jelali (2013), Table 11.1, after Ruel (2000); limits of the process gain 0.5 and 3, as far as the text keeps them"
# parameter: (ideal, practical, lowest acceptable, highest acceptable)
LIMITS = {
    "process gain (%/%)": ("1", "< 0.5: too small; 0.5 to 3: acceptable; > 3: too high", 0.5, 3.0),
    "noise band (%)": ("0", "< 0.5: acceptable", 0.0, 0.5),
    "hysteresis (%)": ("0", "< 3: acceptable; > 3: to be checked", 0.0, 3.0),
    "stiction (%)": ("0", "1: desirable; > 1: to be checked", 0.0, 1.0),
}
VALVES = {
    "good valve": ("choudhury", {"S": 0.4, "J": 0.2}, 1.2, 0.05),
    "worn linkage": ("hysteresis", {"S": 0.5, "H": 4.5}, 0.8, 0.05),
    "sticky, oversized": ("choudhury", {"S": 3.0, "J": 1.1}, 3.6, 0.1),
}


def data() -> pd.DataFrame:
    """Measure three valves as an engineer would: in manual, by steps.

    Returns
    -------
    DataFrame
        parameter, ideal, practical, and per valve the measured value and whether it is acceptable (NAME: ok).
    """
    frame = pd.DataFrame(
        [[name, ideal, practical] for name, (ideal, practical, _, _) in LIMITS.items()],
        columns=["parameter", "ideal", "practical"],
    )
    for name, valve in VALVES.items():
        measured = measure(*valve)
        frame[name] = [measured[p] for p in LIMITS]
        frame[f"{name}: ok"] = [low <= measured[p] <= high for p, (_, _, low, high) in LIMITS.items()]
    return frame


def measure(model: str, parameters: dict[str, float], K: float, noise: float) -> dict[str, float]:
    """Return the four parameters of one valve with its process.

    Process gain: PV over OP across the big steps of the travel test. Noise band: four standard deviations of PV while OP
    rests. Hysteresis: largest separation of MV over a full traverse, less the dead-band. Stiction: the small steps in the same
    direction that the travel test needs.
    """
    controller = {"type": "PI", "Kc": 0.3, "Ti": 5.0}
    plant = {"type": "foptd", "K": K, "T": 5.0, "Td": 1.0}
    valve = {"model": model, **parameters}
    loop = Loop.from_table(
        {"plant": plant, "controller": controller, "valve": valve, "sampling": {"Ts": 1.0}, "noise": {"std": noise}}
    )
    found = travel_test(loop)
    wait = round(found.wait / found.Ts)
    op, pv = found.trace.op, found.trace.pv
    last = int(np.flatnonzero(found.phase == 0)[-1])
    # the last two levels of the big steps: the valve moved between them, or it moved from rest
    gain = (pv[last - 5 : last + 1].mean() - pv[wait - 6 : wait].mean()) / (op[last] - op[0])
    traverse = np.concatenate([np.linspace(0, 100, 1001), np.linspace(100, 0, 1001), np.linspace(0, 100, 1001)])
    mv = valve_response(model, traverse, parameters)
    up, down = mv[2002:], mv[1001:2002][::-1]
    moved = np.flatnonzero(np.abs(mv[1001:2002] - mv[1001]) > 0.01)[0]
    return {
        "process gain (%/%)": float(gain),
        "noise band (%)": float(4 * pv[wait // 2 : wait].std()),
        "hysteresis (%)": max(float((down - up).max()) - 0.1 * float(moved), 0.0),
        "stiction (%)": float(found.J or 0.0),
    }


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the table; what is to be checked is framed."""
    shown = data[["parameter", "ideal", "practical"]].copy()
    framed = set()
    for j, name in enumerate(VALVES):
        shown[name] = [f"{x:.2g}" for x in data[name]]
        framed |= {(i, 3 + j) for i, ok in enumerate(data[f"{name}: ok"]) if not ok}
    foot = (
        "Measured on simulated loops in manual: stiction by the travel test in the same direction (+0/-0.2 %), hysteresis over "
        "a full traverse less the dead-band. Framed: to be checked."
    )
    return table(shown, [19, 6, 34, 12, 13, 18], framed=framed, foot=foot)

"""Horch's verdict depends on w Ti, not on the valve: sticky loops and healthy loops under a sine
fall on one curve.

In a PI loop OP answers PV alone, so dtau = (2/pi) atan(1/(w Ti)) for any linear loop; the verdict
changes at w Ti = 0.577 and at 1.73.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.figures._cycles import sustained_cycle
from simbench.figures._loops import choudhury, pi_loop, sine
from simbench.figures._style import BLACK, BLUE, GREY, RED, label, panel, styled
from simbench.loop.simulate import simulate

SOURCE = "He et al. (2007), analysis of Horch (1999); Jelali (2013), Sect. 11.5"
Td, PERIODS = 20.0, 20
# healthy loops: w Ti of the outside sine; sticky loops: T = Ti over Td, which sets w Ti of their
# cycle
W_TI = np.geomspace(0.08, 12.0, 30)
T_OVER_TD = np.geomspace(0.2, 40.0, 30)


def healthy(w_Ti: float) -> tuple[LoopRecord, float]:
    """Return the record of a healthy loop under a sine of 60 s, and w Ti."""
    Ti = w_Ti * 60.0 / (2 * np.pi)
    loop = pi_loop(
        T=3.0,
        Td=1.0,
        Kc=min(0.1 * Ti, 1.0),
        Ti=Ti,
        Ts=0.2,
        n=300 * (PERIODS + 15),
        disturbance=sine(2.0, 60.0),
    )
    record = simulate(loop).record
    return record.window(record.n - 300 * PERIODS, record.n), w_Ti


def sticky(ratio: float) -> tuple[LoopRecord, float]:
    """Return the record of a sticky loop with T = Ti = ratio Td in its cycle, and w Ti."""
    T = ratio * Td
    loop = pi_loop(T=T, Td=Td, Kc=0.5 * ratio, Ti=T, Ts=1.0, valve=choudhury(5.0, 2.5))
    cycle = sustained_cycle(loop, PERIODS)
    record = LoopRecord(op=cycle["OP (%)"], pv=cycle["PV"], Ts=1.0, process="self-regulating")
    return record, float(2 * np.pi / cycle["period (s)"].iloc[0] * T)


def data() -> pd.DataFrame:
    """Judge sticky and healthy loops over two decades of w Ti.

    Columns: valve ("sticky" or "healthy"), w_Ti (-), dtau (-), drho (-), verdict.
    """
    rows = []
    for valve, make, values in (("healthy", healthy, W_TI), ("sticky", sticky, T_OVER_TD)):
        for value in values:
            record, w_Ti = make(float(value))
            verdict = judge(record, ["horch"])[0]
            rows.append(
                [valve, w_Ti, verdict.indices["dtau"], verdict.indices["drho"], verdict.verdict]
            )
    return pd.DataFrame(rows, columns=["valve", "w_Ti (-)", "dtau (-)", "drho (-)", "verdict"])


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw dtau over w Ti for both kinds of loops, with the law and the limits of the verdict."""
    figure, axes = panel(6.4, 4.0)
    x = np.geomspace(0.06, 16, 200)
    axes.plot(
        x,
        2 / np.pi * np.arctan(1 / x),
        color=BLACK,
        linewidth=0.9,
        label=r"$(2/π)\,\arctan(1/(ωT_i))$",
    )
    for valve, marker, colour in (("healthy", "s", BLUE), ("sticky", "o", RED)):
        part = data[data["valve"] == valve]
        name = "healthy, outside sine" if valve == "healthy" else "sticky valve"
        axes.plot(
            part["w_Ti (-)"],
            part["dtau (-)"],
            marker,
            color=colour,
            markersize=4.5,
            markerfacecolor="none",
            label=name,
        )
    for limit in (1 / 3, 2 / 3):
        axes.axhline(limit, color=GREY, linestyle="--", linewidth=0.8)
    for limit in (1 / np.sqrt(3), np.sqrt(3)):
        axes.axvline(limit, color=GREY, linestyle=":", linewidth=0.8)
        axes.text(limit * 1.04, 1.03, f"{limit:.3g}", color=GREY, fontsize=7.5)
    for y, text in ((0.83, "called stiction"), (0.5, "no decision"), (0.24, "called no stiction")):
        axes.text(15.5, y, text, ha="right", va="center", color=GREY)
    axes.set(xscale="log", xlim=(0.06, 16), ylim=(0, 1.1))
    label(axes, "ωTᵢ (-)", "Δτ (-)")
    axes.legend(loc="lower left")
    return figure

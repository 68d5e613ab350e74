"""Simulate sticky loops on their limit cycle for the figures, cut whole periods, and draw them in
five rows.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.signal.oscillation import zero_crossings
from simbench.figures._loops import COLUMNS, Loops
from simbench.loop.simulate import simulate
from simbench.page.style import SIGNAL, label, panels
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import cycle_start, exact_cycle
from simbench.theory.sampled import sampled_loop


def sustained_cycle(loop: Loop, periods: int) -> pd.DataFrame:
    """Return whole periods of a sticky loop's cycle, begun where OP crosses its mean
    upwards.
    """
    # A run that is long enough for the exact cycle
    Ts = loop.sampling.Ts
    exact = exact_cycle(sampled_loop(loop))
    if exact is None:
        length = 1000
    else:
        length = round((2 * periods + 2) * exact.period / Ts)
    record = simulate(loop.with_("sampling.n", length), start=cycle_start(loop)).record

    # Rising crossings of OP's mean bound whole periods
    op = record.op
    mv = record.mv
    pv = record.pv - record.sp
    at = zero_crossings(op - op.mean(), 0.25 * float(op.std()))
    up = at[op[np.minimum(at.astype(int) + 1, op.size - 1)] > op.mean()]
    start = round(up[-periods - 1])
    stop = round(up[-1])

    # The periods, with PV about its set point
    return pd.DataFrame(
        {
            "period (s)": (up[-1] - up[-periods - 1]) / periods * Ts,
            "t (s)": np.arange(stop - start) * Ts,
            "OP (%)": op[start:stop],
            "MV (%)": mv[start:stop],
            "PV - SP": pv[start:stop],
        }
    )


def panel_cycles(
    panels: Sequence[tuple[str, float, float]],
    ratio: str,
    loop: Callable[[float, float, Loops], Loop],
    loops: Loops,
) -> pd.DataFrame:
    """Return three periods of the cycle of every panel's loop, after the panel, its ratio of dead
    time and its S/2J, and before the loop's numbers.
    """
    cycles = []
    for panel, dead, band in panels:
        cycle = sustained_cycle(loop(dead, band, loops), periods=3)
        own = loops.last
        base = COLUMNS["T" if ratio == "Td_over_T" else "Ti"]
        drawn = own[COLUMNS["Td"]] / own[base]
        ratios = (("S_over_2J", own[COLUMNS["S"]] / (2 * own[COLUMNS["J"]])), (ratio, drawn))
        for name, value in ratios:
            cycle.insert(0, name, float(f"{value:.12g}"))
        cycle.insert(0, "panel", panel)
        cycles.append(cycle.assign(**own))
    return pd.concat(cycles, ignore_index=True)


def draw_cycles(data: pd.DataFrame, ratio: str, shown: str, pv_label: str) -> Figure:
    """Draw OP, MV and PV over time, MV over OP and PV over OP, one column per loop."""
    # each loop begins anew
    cycles = [cycle for _, cycle in data.groupby((data["t (s)"] == 0.0).cumsum())]
    figure, axes = panels(5, len(cycles), 11.0, 9.0)
    for j, cycle in enumerate(cycles):
        first = cycle.iloc[0]
        title = f"({first.panel}) {shown} = {first[ratio]:.3g}\n$S/2J$ = {first.S_over_2J:.3g}"
        t = cycle["t (s)"].to_numpy()
        op = cycle["OP (%)"].to_numpy()
        mv = cycle["MV (%)"].to_numpy()
        pv = cycle["PV - SP"].to_numpy()
        for i, (signal, values) in enumerate((("OP", op), ("MV", mv), ("PV", pv))):
            axes[i, j].plot(t, values, color=SIGNAL[signal])
            label(
                axes[i, j],
                "time (s)",
                {"OP": "OP (%)", "MV": "MV (%)", "PV": pv_label}[signal] if j == 0 else "",
            )
        axes[3, j].plot(op, mv, color=SIGNAL["MV"])
        axes[4, j].plot(op, pv, color=SIGNAL["PV"])
        label(axes[3, j], "OP (%)", "MV (%)" if j == 0 else "")
        label(axes[4, j], "OP (%)", pv_label if j == 0 else "")
        axes[0, j].set_title(title)
    figure.align_ylabels()
    return figure

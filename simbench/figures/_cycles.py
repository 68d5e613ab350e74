"""Simulate sticky loops on their limit cycle for the figures, cut whole periods, and draw them in
five rows.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.signal.oscillation import zero_crossings
from simbench.figures._style import SIGNAL, label, panels
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import cycle_start, exact_cycle
from simbench.theory.sampled import sampled_loop


def sustained_cycle(loop: Loop, periods: int) -> pd.DataFrame:
    """Return whole periods of a sticky loop's cycle, begun where OP crosses its mean
    upwards.
    """
    Ts = loop.sampling.Ts
    exact = exact_cycle(sampled_loop(loop))
    length = 1000 if exact is None else round((2 * periods + 2) * exact.period / Ts)
    record = simulate(loop.with_("sampling.n", length), start=cycle_start(loop)).record
    op, mv, pv = record.op, record.mv, record.pv - record.sp
    at = zero_crossings(op - op.mean(), 0.25 * float(op.std()))
    up = at[op[np.minimum(at.astype(int) + 1, op.size - 1)] > op.mean()]
    start, stop = round(up[-periods - 1]), round(up[-1])
    return pd.DataFrame(
        {
            "period (s)": (up[-1] - up[-periods - 1]) / periods * Ts,
            "t (s)": np.arange(stop - start) * Ts,
            "OP (%)": op[start:stop],
            "MV (%)": mv[start:stop],
            "PV": pv[start:stop],
        }
    )


def panel_cycles(
    panels: Sequence[tuple[str, float, float]], ratio: str, loop: Callable[[float, float], Loop]
) -> pd.DataFrame:
    """Return three periods of the cycle of every panel's loop, after the panel, its ratio of dead
    time and its S/2J.
    """
    cycles = []
    for panel, dead, band in panels:
        cycle = sustained_cycle(loop(dead, band), periods=3)
        for name, value in (("S_over_2J", band), (ratio, dead), ("panel", panel)):
            cycle.insert(0, name, value)
        cycles.append(cycle)
    return pd.concat(cycles, ignore_index=True)


def draw_cycles(
    data: pd.DataFrame, keys: Sequence[str], titles: Sequence[str], pv_label: str
) -> Figure:
    """Draw OP, MV and PV over time, MV over OP and PV over OP, one column per loop."""
    figure, axes = panels(5, len(titles), 11.0, 9.0)
    for j, (title, (_, cycle)) in enumerate(zip(titles, data.groupby(list(keys), sort=False))):
        t, op, mv, pv = (cycle[c].to_numpy() for c in ("t (s)", "OP (%)", "MV (%)", "PV"))
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

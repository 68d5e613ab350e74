"""Draw an empirical model: where in the record it acts, its curve with an interval, and what it
does not explain.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import step

from detectors.errors import UserError
from simbench.figures._style import BLACK, BLUE, GREY, RED, label, panels, styled
from simbench.gap.closed_loop.lacking import Lacking
from simbench.gap.discover.discovery import Discovery
from simbench.gap.report.pictures import PHONE_WIDTH
from simbench.loop.laws import apply_law, law_parameters
from simbench.loop.parameters import resolve
from simbench.loop.response import stages_response
from simbench.loop.setup import plain_setup

_Curve = tuple[np.ndarray, np.ndarray, str, str]  # x, y, names of both axes


@styled
def draw_windows(discovery: Discovery) -> Figure:
    """Draw PV and OP of the record, the spells in which the law acts shaded."""
    s = discovery.situation
    figure, grid = panels(2, 1, PHONE_WIDTH, 3.2, sharex=True)
    t = np.arange(s.record.n) * s.record.Ts
    for axes, x, name in zip(grid[:, 0], (s.record.pv, s.op), ("PV", "OP (%)")):
        axes.plot(t, x, color=BLACK, linewidth=0.7)
        for a, b in discovery.windows:
            axes.axvspan(a, b, color=RED, alpha=0.18, linewidth=0)
        label(axes, "", name)
    grid[0, 0].plot(t, s.sp, color=GREY, linestyle=":", linewidth=1.0)
    grid[1, 0].set_xlabel("time (s)")
    return figure


@styled
def draw_law(discovery: Discovery) -> Figure:
    """Draw a law that has a curve in its block's coordinates, with the band of its interval."""
    law, curve = discovery.law, law_curve(discovery)
    assert law is not None
    assert curve is not None
    x, y, across, up = curve
    figure, grid = panels(1, 1, PHONE_WIDTH, 3.0)
    axes: Axes = grid[0, 0]
    ends = [{**law.numbers, name: value} for name, pair in law.intervals.items() for value in pair]
    near = [c[1] for c in (law_curve(discovery, numbers) for numbers in ends) if c is not None]
    if near:
        axes.fill_between(
            x,
            np.min([y, *near], axis=0),
            np.max([y, *near], axis=0),
            color=RED,
            alpha=0.2,
            linewidth=0,
        )
    plain = law_curve(discovery, {})
    if plain is not None:
        axes.plot(x, plain[1], color=GREY, linestyle=":", label="without it")
    axes.plot(x, y, color=RED, label="the law")
    axes.legend(loc="best")
    label(axes, across, up)
    return figure


@styled
def draw_lacking(lacks: Lacking) -> Figure:
    """Draw the features in which the record differs from its simulation in every stretch of it, as
    bars.
    """
    rows = lacks.features[:8][::-1]
    figure, grid = panels(1, 1, PHONE_WIDTH, 0.9 + 0.34 * len(rows))
    axes: Axes = grid[0, 0]
    axes.barh(
        range(len(rows)),
        [z for _, z in rows],
        color=[RED if z > 0 else BLUE for _, z in rows],
        height=0.6,
    )
    axes.set_yticks(range(len(rows)), [words for words, _ in rows], fontsize=6.5)
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_xlabel("record beside its simulation\n(seed-to-seed standard deviations)")
    return figure


def law_curve(discovery: Discovery, numbers: dict[str, float] | None = None) -> _Curve | None:
    """Return what a valve makes of OP that goes to and fro, or a plant or sensor of a step, with a
    law in the loop; None where the law has no curve.
    """
    s, law = discovery.situation, discovery.law
    assert law is not None
    numbers = dict(law.numbers) if numbers is None else numbers
    setup = plain_setup(s.baseline, 0)
    try:
        p = resolve(law_parameters(law.form), numbers, law.form)
        apply_law(law.form, setup, p, np.random.default_rng(0))
    except UserError:
        return None
    if law.block == "valve":
        low, high = float(s.op.min()), float(s.op.max())
        way = np.linspace(0.0, 2.5, 600)
        op = low + (high - low) * np.abs((way + 1.0) % 2.0 - 1.0)
        moved = stages_response(tuple(setup.valves), op, op[0])
        return way * (high - low), moved, "way of OP, up, down and up again (%)", "MV (%)"
    if law.form in ("size", "zero"):
        den = np.polymul(setup.den, [setup.sensor_tau, 1.0])
        t = np.linspace(0.0, 6.0 * (s.data.T + s.data.Td + 1.0) * s.record.Ts, 300)
        _, y = step((setup.num, den), T=t)
        return t + s.baseline.plant.Td, y, "time after a step of MV by 1 % (s)", "PV (PV units)"
    if law.form == "regime":
        e = np.quantile(s.sp - s.record.pv, np.linspace(0.01, 0.99, 99))
        return (
            e,
            e * (p.gain + p.square * np.abs(e)) + p.side * np.abs(e),
            "error (PV units)",
            "error as it counts (PV units)",
        )
    return None

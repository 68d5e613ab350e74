"""Draw an empirical model, its curve with an interval, and what a simulation lacks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import step

from simbench.detectors.errors import UserError
from simbench.figures._style import BLACK, BLUE, GREY, RED, label, panel, styled
from simbench.gap.closed_loop.lacking import Lacking
from simbench.gap.discover.discovery import Discovery
from simbench.gap.report.pictures import PHONE_WIDTH, fill_bars
from simbench.loop.laws import apply_law, law_parameters
from simbench.loop.parameters import resolve
from simbench.loop.response import stages_response
from simbench.loop.setup import plain_setup

_Curve = tuple[np.ndarray, np.ndarray, str, str]  # x, y, names of both axes


@styled
def draw_law(discovery: Discovery) -> Figure:
    """Draw a law that has a curve in its block's coordinates, with the band of its interval."""
    law = discovery.law
    assert law is not None
    ends = [{name: value} for name, pair in law.intervals.items() for value in pair]
    curves = [law_curve(discovery, {**law.numbers, **end}) for end in ({}, *ends)]
    (x, y, across, up), *_ = known = [curve for curve in curves if curve is not None]
    band = [curve[1] for curve in known]
    figure, axes = panel(PHONE_WIDTH, 3.0)
    low, high = np.min(band, axis=0), np.max(band, axis=0)
    axes.fill_between(x, low, high, color=RED, alpha=0.2, linewidth=0)
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
    shown = dict(lacks.features[:8])
    figure, axes = panel(PHONE_WIDTH, 0.9 + 0.34 * len(shown))
    fill_bars(axes, shown, [RED if z > 0 else BLUE for z in shown.values()])
    axes.tick_params(axis="y", labelsize=6.5)
    axes.margins(x=0.25)
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_xlabel("record beside its simulation\n(seed-to-seed standard deviations)")
    return figure


def law_curve(discovery: Discovery, numbers: Mapping[str, float]) -> _Curve | None:
    """Return what a valve makes of OP that goes to and fro, or a plant or sensor of a step, with a
    law of these numbers in the loop; None where the law has no curve.
    """
    s, law = discovery.situation, discovery.law
    assert law is not None
    setup = plain_setup(s.baseline, 0)
    try:
        p = resolve(law_parameters(law.form), numbers, law.form)
        apply_law(law.form, setup, p, np.random.default_rng(0))
    except UserError:
        return None
    if law.block == "valve":
        low, wide = float(s.op.min()), float(np.ptp(s.op))
        way = np.linspace(0.0, 2.5, 600)
        op = low + wide * np.abs((way + 1.0) % 2.0 - 1.0)
        moved = stages_response(tuple(setup.valves), op, op[0])
        return way * wide, moved, "way of OP, up, down and up again (%)", "MV (%)"
    if law.block == "process":
        den = np.polymul(setup.den, [setup.sensor_tau, 1.0])
        t = np.linspace(0.0, 6.0 * (s.data.T + s.data.Td + 1.0) * s.record.Ts, 300)
        _, y = step((setup.num, den), T=t)
        return t + s.baseline.plant.Td, y, "time after a step of MV by 1 % (s)", "PV (PV units)"
    if law.form == "regime":
        e = np.quantile(s.sp - s.record.pv, np.linspace(0.01, 0.99, 99))
        counts = e * (p.gain + p.square * np.abs(e)) + p.side * np.abs(e)
        return e, counts, "error (PV units)", "error as it counts (PV units)"
    return None

"""Pictures of a law: where in the record it acts, the law in its own coordinates with its interval, its numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.figures._style import BLACK, BLUE, GREY, RED, label, panels, styled
from simbench.gap.closed_loop.lacking import Lacking
from simbench.gap.discover.discovery import Discovery
from simbench.gap.discover.law import Law
from simbench.gap.discover.moves import led, rung
from simbench.gap.discover.nearest import curve_of
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.valve_map import lagged
from simbench.gap.situation import Situation
from simbench.loop.laws import FORMS

_WIDTH = 4.6  # inches; no wider, or the letters are too small on a phone
_SHARES = (0.0, 0.5, 1.0)  # of a law's interval, whose curves bound the band drawn

_Curve = tuple[np.ndarray, np.ndarray, np.ndarray, str, str]  # x, y, y without the law, names of both axes


@styled
def draw_windows(found: Discovery) -> Figure:
    """Draw PV and OP of the record, the spells in which the law acts shaded."""
    s = found.situation
    figure, grid = panels(2, 1, _WIDTH, 3.2, sharex=True)
    t = np.arange(s.record.n) * s.record.Ts
    for axes, x, name in zip(grid[:, 0], (np.asarray(s.record.pv), s.op), ("PV", "OP (%)")):
        axes.plot(t, x, color=BLACK, linewidth=0.7)
        for a, b in found.windows:
            axes.axvspan(a, b, color=RED, alpha=0.18, linewidth=0)
        label(axes, "", name)
    grid[0, 0].plot(t, s.sp, color=GREY, linestyle=":", linewidth=1.0)
    grid[1, 0].set_xlabel("time (s)")
    return figure


@styled
def draw_law(found: Discovery) -> Figure:
    """Draw the law in its block's coordinates, with the band of its interval; its numbers where it has no curve."""
    law, s = found.law, found.situation
    assert law is not None
    draw = _CURVES.get(law.form)
    if draw is None:
        return _numbers(law)
    figure, grid = panels(1, 1, _WIDTH, 3.0)
    axes: Axes = grid[0, 0]
    x, y, plain, across, up = draw(s, law.numbers)
    between = [draw(s, numbers)[1] for numbers in _around(law)]
    if between:
        axes.fill_between(x, np.min([y, *between], axis=0), np.max([y, *between], axis=0), color=RED, alpha=0.2, linewidth=0)
    axes.plot(x, plain, color=GREY, linestyle=":", label="simulation without it")
    axes.plot(x, y, color=RED, label="the law")
    axes.legend(loc="best")
    label(axes, across, up)
    return figure


@styled
def draw_lacking(lacks: Lacking) -> Figure:
    """Draw the features in which the record differs from its simulation in every stretch of it, as bars."""
    rows = lacks.features[:8][::-1]
    figure, grid = panels(1, 1, _WIDTH, 0.9 + 0.34 * len(rows))
    axes: Axes = grid[0, 0]
    axes.barh(range(len(rows)), [z for _, z, _ in rows], color=[RED if z > 0 else BLUE for _, z, _ in rows], height=0.6)
    axes.set_yticks(range(len(rows)), [words for words, _, _ in rows], fontsize=6.5)
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_xlabel("record beside its simulation\n(seed-to-seed standard deviations)")
    return figure


def _around(law: Law) -> list[dict[str, float]]:
    """Return the numbers at the ends of each one's interval, within what the form allows."""
    rules, out = FORMS[law.form].numbers, []
    for name, ends in law.intervals.items():
        for value in ends:
            if name in rules and np.isfinite(value):
                out.append({**law.numbers, name: float(np.clip(value, rules[name].low, rules[name].high))})
    return out


def _numbers(law: Law) -> Figure:
    rules = FORMS[law.form].numbers
    figure, grid = panels(len(law.numbers), 1, _WIDTH, 0.3 + 0.75 * len(law.numbers))
    for axes, (name, value) in zip(grid[:, 0], law.numbers.items()):
        low, high = law.intervals.get(name, (value, value))
        axes.plot([low, high], [0, 0], color=RED, linewidth=3.0, alpha=0.4)
        axes.plot([value], [0], "o", color=RED)
        axes.set_yticks([])
        label(axes, f"{name}{f' ({rules[name].unit})' if rules[name].unit != '-' else ''}: {rules[name].says}", "")
    return figure


def _of_op(move: Callable[[np.ndarray, dict[str, float]], np.ndarray]) -> Callable[..., _Curve]:
    def curve(s: Situation, p: dict[str, float]) -> _Curve:
        x = np.linspace(float(s.op.min()), float(s.op.max()), 200)
        return x, move(x, p), x, "OP (%)", "MV (%)"

    return curve


def _loop_of(s: Situation, p: dict[str, float]) -> _Curve:
    low, high = float(s.op.min()), float(s.op.max())
    way = np.linspace(0, 3 * np.pi, 600)
    u = np.ascontiguousarray(0.5 * (low + high) - 0.5 * (high - low) * np.cos(way))
    kind = kernels.STICK if p.get("J", 0.0) > 0.0 else kernels.PLAY
    v = kernels.valve(u, kind, p["S"], p.get("J", 0.0), 0.0)
    return np.arange(u.size) / u.size, v, u, "OP to and fro over its range", "MV, and OP dotted (%)"


def _answer(move: Callable[[np.ndarray, dict[str, float], float], np.ndarray], name: str) -> Callable[..., _Curve]:
    """Return the curve of an answer to a step at a fifth of the time drawn, in samples of a twentieth of the plant's pace."""

    def curve(s: Situation, p: dict[str, float]) -> _Curve:
        pace = (s.data.T + s.data.Td + 1.0) * s.record.Ts
        long = max(8.0 * pace, 3.0 * max(p.get("period", 0.0), abs(p.get("lead", 0.0)), p.get("tau", 0.0)))
        dt = long / 400
        u = (np.arange(500) >= 100).astype(float)
        return (np.arange(500) - 100) * dt, move(u, p, dt), u, "time after a step (s)", name

    return curve


def _reading(s: Situation, p: dict[str, float]) -> _Curve:
    pv = np.asarray(s.record.pv)
    x = np.linspace(float(pv.min()), float(pv.max()), 200)
    d = x - s.sp[0]
    y = np.expm1(np.clip(p.get("tilt", 0.0) * d, -30, 30)) / p["tilt"] if p.get("tilt") else d
    if bend := p.get("bend", 0.0):
        y = np.arcsinh(bend * y) / bend if bend > 0 else np.sinh(np.clip(bend * y, -30, 30)) / bend
    return x, y + s.sp[0], x, "PV if the gain were the same everywhere", "PV"


def _gain(s: Situation, p: dict[str, float]) -> _Curve:
    if p.get("schedule"):
        x = np.linspace(float(s.op.min()), float(s.op.max()), 200)
        return x, 1.0 + p["schedule"] * (x - s.op.mean()), np.ones_like(x), "OP (%)", "gain, times Kc"
    e = s.sp - np.asarray(s.record.pv)
    x = np.linspace(*np.quantile(e, (0.005, 0.995)), 200)
    y = p.get("gain", 1.0) + p.get("square", 0.0) * np.abs(x) + p.get("side", 0.0) * np.sign(x)
    return x, y, np.ones_like(x), "error (PV units)", "gain, times Kc"


def _slow(u: np.ndarray, p: dict[str, float], dt: float) -> np.ndarray:
    v = lagged(u, max(p.get("tau", 0.0) / dt, 0.01))
    if p.get("slowness", 0.0) > 0.0:
        v = np.clip(np.cumsum(u > 0) * dt / p["slowness"] / 5.0, 0.0, 1.0)
    return v


_CURVES: dict[str, Any] = {
    "curve": _of_op(lambda x, p: curve_of(p, x)),
    "stops": _of_op(lambda x, p: np.clip(x, p.get("low", 0.0), p.get("high", 100.0))),
    "memory": _loop_of,
    "rate": _answer(_slow, "MV after a step of OP by 5 %, as its share"),
    "pole": _answer(lambda u, p, dt: lagged(u, max(p["tau"] / dt, 0.01)), "added to the plant's answer"),
    "filter": _answer(lambda u, p, dt: lagged(u, max(p["tau"] / dt, 0.01)), "reading"),
    "zero": _answer(lambda u, p, dt: led(u, p["lead"] / dt, p["lag"] / dt), "added to the plant's answer"),
    "resonance": _answer(lambda u, p, dt: rung(u, p["period"] / dt, p["damping"]), "added to the plant's answer"),
    "bent": _reading,
    "regime": _gain,
}

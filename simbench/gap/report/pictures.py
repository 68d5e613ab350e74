"""Draw a diagnosis: signals, PV-OP plots, what remains, probabilities, and the gap as bars."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.remaining import Remaining
from simbench.page.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    label,
    panel,
    panels,
    styled,
)

# what is drawn
RECORD = "record"
BASELINE = "baseline"
IDENTIFIED = "identified"
TUNED = "recalibrated"
FIXED = "with the effect"
SHOWN = "as the record shows it"
NEAREST = "with the nearest effect"

Traces = Mapping[str, LoopRecord]  # the record and its simulations by name, the record first
PHONE_WIDTH = 4.6  # inches; no wider, or the letters are too small on a phone
LOOK = {
    RECORD: BLACK,
    BASELINE: BLUE,
    IDENTIFIED: BLUE,
    TUNED: GREEN,
    FIXED: RED,
    NEAREST: ORANGE,
    SHOWN: RED,
}
_OF_GAP = {
    "before": BLUE,
    "recalibrated": GREEN,
    "after": RED,
    "nearest effect": ORANGE,
    "floor": GREY,
    "plant floor": GREY,
}
_OF_BLOCK = {
    "controller": GREEN,
    "valve": RED,
    "process": BLUE,
    "disturbance": ORANGE,
    "sensor": BLACK,
}
_BEYOND = 2.0  # share of the record's range that a runaway simulation may be drawn beyond it


def _op_label(record: LoopRecord) -> str:
    return "OP (%)" if record.op_percent is not None else "OP (its own units)"


@styled
def draw_traces(signal: str, traces: Traces, part: slice) -> Figure:
    """Draw one signal over time: the record on top, a panel per simulation below, all on the same
    axes.
    """
    high = 0.5 + 1.15 * len(traces)
    figure, grid = panels(len(traces), 1, PHONE_WIDTH, high, sharex=True, sharey=True)
    fill_traces(grid[:, 0], signal, traces, part)
    return figure


def fill_traces(panels: Iterable[Axes], signal: str, traces: Traces, part: slice) -> None:
    """Draw one signal over time, a panel each, as `draw_traces`."""
    limits = _limits_around([_signal_of(trace, signal)[part] for trace in traces.values()])
    for axes, (name, trace) in zip(panels, traces.items()):
        x = _signal_of(trace, signal)[part]
        last = name == list(traces)[-1]
        if signal == "PV" and trace.sp is not None:
            axes.plot(trace.t[part], trace.sp[part], color=GREY, linestyle=":", linewidth=1.0)
        axes.plot(trace.t[part], x, color=LOOK[name], linewidth=0.9)
        label(
            axes, "time (s)" if last else "", _op_label(trace) if signal == "OP" else signal, name
        )
        axes.set_ylim(*limits)
        _mark_beyond(axes, x, limits)


@styled
def draw_loops(across: str, traces: Traces, part: slice) -> Figure:
    """Draw PV (or MV) over OP, a panel each for the record and every simulation, all on the same
    axes.
    """
    # a panel each on common axes
    rows = (len(traces) + 1) // 2
    figure, grid = panels(rows, 2, PHONE_WIDTH, 0.3 + 1.85 * rows, sharex=True, sharey=True)
    both = {}
    for name, t in traces.items():
        both[name] = (t.op[part], _signal_of(t, across)[part])
    sideways, upwards = (_limits_around(signals) for signals in zip(*both.values()))

    # the loops, and a word where one runs away
    for axes in grid.flat[len(both) :]:
        axes.set_axis_off()
    for axes, (name, (op, x)) in zip(grid.flat, both.items()):
        axes.plot(op, x, color=LOOK[name], linewidth=0.7, alpha=0.9)
        label(axes, "", "", name)
        if not _mark_beyond(axes, op, sideways):
            _mark_beyond(axes, x, upwards)

    # what the axes are
    grid[0, 0].set(xlim=sideways, ylim=upwards)
    figure.supxlabel(_op_label(next(iter(traces.values()))), fontsize="medium")
    figure.supylabel("MV (%)" if across == "MV" else across, fontsize="medium")
    return figure


@styled
def draw_ranking(probabilities: Mapping[str, float]) -> Figure:
    """Draw candidates as bars of their probability."""
    figure, axes = panel(PHONE_WIDTH, 0.65 + 0.34 * len(probabilities))
    fill_ranking(axes, probabilities)
    return figure


def fill_ranking(axes: Axes, probabilities: Mapping[str, float]) -> None:
    """Draw candidates as bars of their probability, the first in colour."""
    fill_bars(axes, probabilities, [RED] + [GREY] * (len(probabilities) - 1))
    axes.set(xlim=(0, 1.12), xlabel="probability")


@styled
def draw_gap(sizes: Mapping[str, float]) -> Figure:
    """Draw the gap of every simulation as a bar, beside what seed-to-seed variation alone gives
    and how far parts of the record are apart.
    """
    figure, axes = panel(PHONE_WIDTH, 0.65 + 0.34 * len(sizes))
    fill_gap(axes, sizes)
    return figure


def fill_gap(axes: Axes, sizes: Mapping[str, float]) -> None:
    """Draw gaps as bars, as `draw_gap`."""
    fill_bars(axes, sizes, [_OF_GAP[name] for name in sizes])
    axes.axvline(sizes["plant floor"], color=GREY, linestyle=":", linewidth=1.0)
    axes.set(
        xlim=(0, 1.15 * max(sizes.values())),
        xlabel="distance from the record (seed-to-seed standard deviations)",
    )


def fill_bars(axes: Axes, values: Mapping[str, float], colours: Sequence[str]) -> None:
    """Draw named values as bars, the first on top, each with its number."""
    places = np.arange(len(values))[::-1]
    bars = axes.barh(places, values.values(), color=colours, height=0.62, tick_label=list(values))
    axes.tick_params(axis="y", length=0)
    # on white, so that the line of the plant floor does not strike a number through
    ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    axes.bar_label(bars, fmt="%.2f", padding=4, fontsize=8, bbox=ground)


def _signal_of(trace: LoopRecord, name: str) -> np.ndarray:
    return getattr(trace, name.lower())


def _limits_around(signals: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return limits that hold the record, which comes first, and what is not far off it."""
    lo = float(signals[0].min())
    hi = float(signals[0].max())
    wide = (hi - lo) or 1.0
    low = max(min(float(s.min()) for s in signals), lo - _BEYOND * wide)
    high = min(max(float(s.max()) for s in signals), hi + _BEYOND * wide)
    return low - 0.04 * wide, high + 0.04 * wide


def _mark_beyond(axes: Axes, x: np.ndarray, limits: tuple[float, float]) -> bool:
    beyond = bool(np.mean((x < limits[0]) | (x > limits[1])) > 0.5)
    if beyond:
        warning = f"runs beyond these axes,\nto {x.min() if x.mean() < limits[0] else x.max():.3g}"
        axes.text(0.5, 0.5, warning, transform=axes.transAxes, ha="center", va="center")
    return beyond


@styled
def draw_remaining(left: Sequence[Remaining], most: int = 8) -> Figure:
    """Draw recorded values as dots beside the range of the simulations, the farthest on top, in
    the colours of their blocks.
    """
    shown = left[:most]
    figure, grid = panels(len(shown), 1, PHONE_WIDTH, 0.3 + 0.62 * len(shown))
    for axes, one in zip(grid[:, 0], shown):
        lo, hi = one.simulated
        axes.plot([lo, hi], [0, 0], color=GREY, linewidth=6, solid_capstyle="butt", alpha=0.6)
        axes.plot(one.recorded, 0, "o", color=_OF_BLOCK[one.block], markersize=5)
        axes.set_title(f"{one.block}: {one.feature}", fontsize=7, loc="left", pad=2)
        axes.set(yticks=[], ylim=(-1, 1))
        axes.margins(x=0.1)
        axes.tick_params(axis="x", labelsize=6.5)
    return figure

"""Draw a diagnosis: probable blocks, signals, PV-OP plots, spectra, probabilities, and the gap
as bars.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import welch

from detectors.record import LoopRecord
from simbench.figures._style import BLACK, BLUE, GREEN, GREY, ORANGE, RED, label, panels, styled
from simbench.gap.report.traces import BASELINE, FIXED, NEAREST, TUNED

PHONE_WIDTH = 4.6  # inches; no wider, or the letters are too small on a phone
RECORD = "record"
LOOK = {
    RECORD: (BLACK, "-"),
    BASELINE: (BLUE, "--"),
    TUNED: (GREEN, "-."),
    FIXED: (RED, "-"),
    NEAREST: (ORANGE, "-"),
    "with the law": (RED, "-"),
}
_BEYOND = 2.0  # share of the record's range that a runaway simulation may be drawn beyond it


@styled
def draw_blocks(shares: Mapping[str, float]) -> Figure:
    """Draw the probability of each block as bars, the largest on top."""
    figure, grid = panels(1, 1, PHONE_WIDTH, 0.65 + 0.28 * len(shares))
    blocks = sorted(shares, key=lambda b: -shares[b])
    fill_ranking(grid[0, 0], blocks, [shares[b] for b in blocks])
    return figure


@styled
def draw_traces(
    signal: str, record: LoopRecord, runs: Mapping[str, LoopRecord], start: int, stop: int
) -> Figure:
    """Draw one signal over time: the record on top, a panel per simulation below, all on the same
    axes.
    """
    every = {RECORD: record, **runs}
    figure, grid = panels(
        len(every), 1, PHONE_WIDTH, 0.5 + 1.15 * len(every), sharex=True, sharey=True
    )
    fill_traces(list(grid[:, 0]), signal, every, start, stop)
    return figure


def fill_traces(
    panels: Sequence[Axes], signal: str, every: Mapping[str, LoopRecord], start: int, stop: int
) -> None:
    """Draw one signal over time, a panel each, as `draw_traces`."""
    limits = _limits([_signal(t.window(start, stop), signal) for t in every.values()])
    for axes, (name, trace) in zip(panels, every.items()):
        part, seconds = trace.window(start, stop), np.arange(start, stop) * trace.Ts
        if signal == "PV" and part.sp is not None:
            axes.plot(seconds, part.sp, color=GREY, linestyle=":", linewidth=1.0)
        axes.plot(seconds, _signal(part, signal), color=LOOK[name][0], linewidth=0.9)
        label(axes, "", signal + (" (%)" if signal == "OP" else ""), name)
        axes.set_ylim(*limits)
        _mark_beyond(axes, _signal(part, signal), limits)
    panels[-1].set_xlabel("time (s)")


@styled
def draw_loops(
    across: str, record: LoopRecord, runs: Mapping[str, LoopRecord], start: int, stop: int
) -> Figure:
    """Draw PV (or MV) over OP, a panel each for the record and every simulation, all on the same
    axes.
    """
    every = {RECORD: record, **runs}
    rows = (len(every) + 1) // 2
    figure, grid = panels(rows, 2, PHONE_WIDTH, 0.3 + 1.85 * rows, sharex=True, sharey=True)
    parts = {name: trace.window(start, stop) for name, trace in every.items()}
    for axes, (name, part) in zip(grid.flat, parts.items()):
        axes.plot(part.op, _signal(part, across), color=LOOK[name][0], linewidth=0.7, alpha=0.9)
        label(axes, "", "", name)
    for axes in grid.flat[len(every) :]:
        axes.set_axis_off()
    figure.supxlabel("OP (%)", fontsize="medium")
    figure.supylabel("MV (%)" if across == "MV" else across, fontsize="medium")
    sideways = _limits([p.op for p in parts.values()])
    upwards = _limits([_signal(p, across) for p in parts.values()])
    grid[0, 0].set(xlim=sideways, ylim=upwards)
    for axes, part in zip(grid.flat, parts.values()):
        if not _mark_beyond(axes, part.op, sideways):
            _mark_beyond(axes, _signal(part, across), upwards)
    return figure


@styled
def draw_spectra(record: LoopRecord, runs: Mapping[str, LoopRecord]) -> Figure:
    """Draw the power spectra of PV and OP over the whole length, record and simulations in one
    panel each.
    """
    figure, grid = panels(2, 1, PHONE_WIDTH, 4.4, sharex=True)
    for axes, signal, unit in zip(grid[:, 0], ("PV", "OP"), ("PV units$^2$ s", "%$^2$ s")):
        for name, trace in {**runs, RECORD: record}.items():
            f, power = spectrum(_signal(trace, signal), trace.Ts)
            axes.loglog(
                f,
                power,
                color=LOOK[name][0],
                linestyle=LOOK[name][1],
                label=name,
                linewidth=2.0 if name == BASELINE else 1.1,
            )
        recorded = spectrum(_signal(record, signal), record.Ts)[1]
        axes.set_ylim(max(recorded.min(), 1e-8 * recorded.max()) / 5.0, recorded.max() * 8.0)
        label(axes, "", f"power of {signal} ({unit})")
    grid[1, 0].set_xlabel("frequency (1/s)")
    grid[0, 0].legend(loc="upper right")
    return figure


def spectrum(x: np.ndarray, Ts: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (1/s) and power density by Welch's averages of at least seven
    half-overlapping pieces.
    """
    f, power = welch(x, 1.0 / Ts, nperseg=max(32, min(1024, x.size // 4)))
    return f[1:], np.maximum(power[1:], np.finfo(float).tiny)


def fill_ranking(axes: Axes, names: Sequence[str], probabilities: Sequence[float]) -> None:
    """Draw candidates as bars of their probability."""
    _bars(axes, names, probabilities, [RED, *[GREY] * (len(names) - 1)])
    axes.set(xlim=(0, 1.12), xlabel="probability")


@styled
def draw_gap(sizes: Mapping[str, float]) -> Figure:
    """Draw the gap of every simulation as a bar, with the floor that seed-to-seed variation alone
    gives.
    """
    figure, grid = panels(1, 1, PHONE_WIDTH, 0.65 + 0.34 * len(sizes))
    fill_gap(grid[0, 0], sizes)
    return figure


def fill_gap(axes: Axes, sizes: Mapping[str, float]) -> None:
    """Draw gaps as bars, as `draw_gap`."""
    colours = {
        "before": BLUE,
        "recalibrated": GREEN,
        "after": RED,
        "nearest effect": ORANGE,
        "floor": GREY,
    }
    _bars(axes, list(sizes), list(sizes.values()), [colours[n] for n in sizes])
    axes.axvline(sizes["floor"], color=GREY, linestyle=":", linewidth=1.0)
    axes.set(
        xlim=(0, 1.15 * max(sizes.values())),
        xlabel="distance from the record (seed-to-seed standard deviations)",
    )


def _bars(
    axes: Axes, names: Sequence[str], values: Sequence[float], colours: Sequence[str]
) -> None:
    places = np.arange(len(names))[::-1]
    axes.barh(places, values, color=colours, height=0.62)
    axes.set_yticks(places, names)
    axes.tick_params(axis="y", length=0)
    for y, value in zip(places, values):
        axes.annotate(
            f"{value:.2f}",
            (value, y),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )


def _signal(trace: LoopRecord, name: str) -> np.ndarray:
    return getattr(trace, name.lower())


def _limits(signals: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return limits that hold the record, which comes first, and what is not far off it."""
    lo, hi = float(signals[0].min()), float(signals[0].max())
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

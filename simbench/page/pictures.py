"""Draw a record: its trend, and PV against OP."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from simbench.detectors.record import LoopRecord
from simbench.page.style import (
    BLUE,
    SIGNAL,
    label,
    panels,
    styled,
)

_POINTS = 700  # drawn of a trend; a longer record is drawn by the extremes of its pieces


@styled
def draw_trend(record: LoopRecord) -> Figure:
    """Draw PV (with SP) above OP over time."""
    # two panels with room for numbers of any width
    figure, axes = panels(2, 1, 5.0, 2.6, sharex=True)
    _place_axes(figure, left=0.18, right=0.985, bottom=0.165, top=0.93, hspace=0.12)
    above, below = axes.ravel()

    # each signal, thinned, in its colour
    hours = 3600.0 if record.duration > 7200 else 60.0
    for ax, signals in ((above, ("sp", "pv")), (below, ("op",))):
        for name in signals:
            x = getattr(record, name)
            if x is not None:
                k = _thin_samples(x)
                ax.plot(record.t[k] / hours, x[k], color=SIGNAL[name.upper()], lw=0.8)

    # names and units
    label(above, "", "PV" if record.sp is None else "PV, SP")
    label(below, "time (h)" if hours == 3600.0 else "time (min)", _op_label(record))
    return figure


@styled
def draw_pv_op(record: LoopRecord) -> Figure:
    """Draw PV against OP."""
    figure, axes = panels(1, 1, 2.6, 2.6)
    _place_axes(figure, left=0.35, right=0.965, bottom=0.165, top=0.93)
    ax = axes.ravel()[0]
    k = np.unique(np.linspace(0, record.n - 1, min(record.n, 2 * _POINTS)).astype(int))
    ax.plot(record.op[k], record.pv[k], color=BLUE, lw=0.5, alpha=0.8)
    label(ax, _op_label(record), "PV")
    return figure


def _place_axes(figure: Figure, **edges: float) -> None:
    """Put the axes where numbers of any width fit; to measure these takes as long as to draw, and a
    plant has hundreds.
    """
    figure.set_layout_engine(None)
    figure.subplots_adjust(**edges)


def _op_label(record: LoopRecord) -> str:
    return "OP" if record.op_percent is None else "OP (%)"


def _thin_samples(x: np.ndarray) -> np.ndarray:
    """Return which samples to draw: all of a short signal, the extremes of every piece of a long
    one.
    """
    if x.size <= 2 * _POINTS:
        return np.arange(x.size)
    size = -(-x.size // _POINTS)
    pieces = np.pad(x, (0, -x.size % size), mode="edge").reshape(-1, size)
    ends = np.concatenate([pieces.argmin(axis=1), pieces.argmax(axis=1)]) + np.tile(
        np.arange(len(pieces)) * size, 2
    )
    return np.unique(np.minimum(ends, x.size - 1))

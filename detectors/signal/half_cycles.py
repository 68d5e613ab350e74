"""Cut an oscillation at its zero crossings, bring each half cycle to one length, and fit shapes
(sine, triangle) to all of them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.signal.autocorrelation import zero_crossings

HALF_CYCLE_POINTS = 40  # samples per resampled half cycle
GUARD = 0.25  # a crossing counts when the signal then passes this many standard deviations


def midline(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the line through the middles of the swings between reversals `at`, level beyond the
    first and the last.
    """
    return np.interp(np.arange(x.size), 0.5 * (at[1:] + at[:-1]), 0.5 * (x[at[1:]] + x[at[:-1]]))


def split(
    x: np.ndarray, period: float, points: int = HALF_CYCLE_POINTS, longest: float = 1.0
) -> np.ndarray:
    """Cut an oscillation into its significant half cycles."""
    at = zero_crossings(x, GUARD * float(x.std()))
    start = at[:-1]
    length = np.diff(at)
    fit = (length > 0.125 * period) & (length < longest * period)
    start = start[fit]
    length = length[fit]
    place = start[:, None] + length[:, None] * ((np.arange(points) + 0.5) / points)
    k = np.minimum(place.astype(int), x.size - 2)
    humps = x[k] + (place - k) * (x[k + 1] - x[k])
    return humps * np.sign(humps.sum(axis=1, keepdims=True))


def misfit(humps: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return the least mean squared error of each half cycle over a family of shapes, each with its
    best height.
    """
    height = (humps @ shapes.T).max(axis=1)
    return np.maximum((humps**2).sum(axis=1) - height**2, 0.0) / humps.shape[1]


def typical_means(*errors: np.ndarray, left_out: float = 0.1) -> list[float]:
    """Return the mean of each kind of misfit over the half cycles that are like the others."""
    total = np.sum(errors, axis=0)
    kept = np.argsort(total, kind="stable")[: total.size - int(left_out * total.size + 1e-9)]
    return [float(error[kept].mean()) for error in errors]


@lru_cache(maxsize=8)
def sines(points: int = HALF_CYCLE_POINTS) -> np.ndarray:
    """Return sines that start at the crossing, with frequencies around pi / length."""
    t = (np.arange(points) + 0.5) / points
    return _scale_to_unit(np.sin(np.pi * np.linspace(0.2, 1.6, 113)[:, None] * t))


@lru_cache(maxsize=8)
def half_sine(points: int = HALF_CYCLE_POINTS) -> np.ndarray:
    """Return the one sine that is zero at both ends."""
    return _scale_to_unit(np.sin(np.pi * (np.arange(points) + 0.5) / points)[None])


@lru_cache(maxsize=8)
def triangles(points: int = HALF_CYCLE_POINTS) -> np.ndarray:
    """Return triangles with zero ends and the apex anywhere."""
    t = (np.arange(points) + 0.5) / points
    apex = np.linspace(0.02, 0.98, 81)[:, None]
    return _scale_to_unit(np.minimum(t / apex, (1.0 - t) / (1.0 - apex)))


def two_line_misfit(humps: np.ndarray) -> np.ndarray:
    """Return the mean squared error of two free straight lines per half cycle, which share its
    largest sample.
    """
    points = humps.shape[1]
    top = np.clip(humps.argmax(axis=1), 1, points - 2)
    row = np.arange(len(humps))
    left = _line_errors(humps)[row, top]
    right = _line_errors(humps[:, ::-1])[row, points - 1 - top]
    return (left + right) / points


def _line_errors(y: np.ndarray) -> np.ndarray:
    """Squared error of the least-squares line through samples 0..k, for every k."""
    t = np.arange(y.shape[1], dtype=float)
    n = t + 1.0
    sy = np.cumsum(y, axis=1)
    sty = np.cumsum(t * y, axis=1)
    syy = np.cumsum(y * y, axis=1)
    st = np.cumsum(t)
    stt = np.cumsum(t * t)
    spread = np.maximum(stt - st**2 / n, 1e-12)
    return np.maximum(syy - sy**2 / n - (sty - st * sy / n) ** 2 / spread, 0.0)


def _scale_to_unit(shapes: np.ndarray) -> np.ndarray:
    shapes = shapes / np.sqrt((shapes**2).sum(axis=1, keepdims=True))
    shapes.flags.writeable = False
    return shapes


@lru_cache(maxsize=8)
def relays(points: int = HALF_CYCLE_POINTS) -> np.ndarray:
    """Return the steady answers of first-order lags to a square wave, each cut where it crosses
    zero.
    """
    t = (np.arange(points) + 0.5) / points
    tau = np.geomspace(0.02, 200.0, 80)[:, None]
    peak = (1.0 - np.exp(-1.0 / tau)) / (1.0 + np.exp(-1.0 / tau))
    # the only switching time for which the half cycle starts at zero
    switch = 1.0 - tau * np.log1p(peak)
    rising = 1.0 - (1.0 + peak) * np.exp(-(t - switch + 1.0) / tau)
    falling = -1.0 + (1.0 + peak) * np.exp(-np.maximum(t - switch, 0.0) / tau)
    return _scale_to_unit(np.where(t <= switch, rising, falling))


def peak_areas(humps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the area of each half cycle before and after its peak."""
    points = humps.shape[1]
    top = np.clip(humps.argmax(axis=1), 1, points - 2)
    row = np.arange(len(humps))
    left = humps[row, top - 1]
    middle = humps[row, top]
    right = humps[row, top + 1]
    bend = left - 2.0 * middle + right
    shift = np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, 1.0), 0.0).clip(
        -0.5, 0.5
    )

    # each sample represents one part; the part that holds the peak is shared
    total = np.cumsum(humps, axis=1) / points
    before = total[row, top] - (0.5 - shift) * middle / points
    return before, total[:, -1] - before

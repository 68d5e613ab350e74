"""Restore a signal from an archive that stores a value only when it changes: between two stored
values the first one holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError

_STORED_CHANGES_NEEDED = 30  # stored changes below which nothing is concluded
# a change is small below this share of the median one; any sampled signal makes 10 % of these
_SMALL = 0.2
_RARE = 0.02
# share of equal intervals from which a signal is sampled more slowly, not stored on change
_COMMON = 0.9
_TOLERANCE = 0.01  # of the sampling period

Series = tuple[np.ndarray, np.ndarray]
# ways between two samples of uneven times
HELD_VALUES = "held"
STRAIGHT_LINES = "linear"


def stored_on_change(t: np.ndarray, x: np.ndarray) -> bool:
    """Whether the stored values of a signal look as if only changes beyond a dead-band were
    kept.
    """
    change = np.abs(np.diff(x))[:-1]  # the last value may stand there only because the export ended
    if change.size < _STORED_CHANGES_NEEDED or np.any(change == 0.0):
        return False
    steps = np.rint(np.diff(t) / np.diff(t).min())
    common = np.unique(steps, return_counts=True)[1].max() / steps.size
    return bool(np.mean(change < _SMALL * np.median(change)) < _RARE and common < _COMMON)


def base_step(t: np.ndarray) -> float | None:
    """Return the step (s) of which all intervals are multiples within 1 %, None without one."""
    dt = np.diff(t)
    step = float(dt.min()) if dt.size else 0.0
    if step <= 0:
        return None
    steps = np.rint(dt / step)
    return (
        step
        if np.all(np.abs(dt - steps * step) <= _TOLERANCE * step * np.maximum(1.0, steps))
        else None
    )


def last_known(times: np.ndarray, t: np.ndarray, x: np.ndarray, before: Any = np.nan) -> np.ndarray:
    """Return the last value stored at each of some times, `before` where there was none yet."""
    at = np.searchsorted(t, times, side="right") - 1
    return np.where(at >= 0, x[np.maximum(at, 0)], before)


def resample(
    series: Mapping[str, Series], Ts: float | None, how: str
) -> tuple[np.ndarray, dict[str, np.ndarray], float, str]:
    """Put samples at uneven times on one even grid, of the median step where none is given: each
    value held until the next, or straight lines between them; a set point is always held. Returns
    also a note.
    """
    times = np.unique(np.concatenate([series["op"][0], series["pv"][0]]))
    steps = np.diff(times)
    Ts = float(np.median(steps)) if Ts is None else Ts
    grid = _grid_of(series, Ts)
    signals = {}
    for role, (t, x) in series.items():
        signals[role] = last_known(grid + _TOLERANCE * Ts, t, x)
        if how == STRAIGHT_LINES and role != "sp":
            signals[role] = np.where(np.isnan(signals[role]), np.nan, np.interp(grid, t, x))
    between = (
        "straight lines between them" if how == STRAIGHT_LINES else "each value held until the next"
    )
    note = (
        f"resampled: {times.size} samples at uneven times on a grid of {Ts:.4g} s, {between}; the"
        f" longest step is {steps.max():.4g} s"
    )
    return grid, signals, Ts, note


def _grid_of(series: Mapping[str, Series], Ts: float) -> np.ndarray:
    """Return the even times at which OP and PV are both known."""
    begin, end = (
        choose(series[r][0][i] for r in ("op", "pv")) for choose, i in ((max, 0), (min, -1))
    )
    return begin + Ts * np.arange(int(np.floor((end - begin) / Ts + 1e-6)) + 1)


def hold(
    series: Mapping[str, Series], Ts: float | None, where: str
) -> tuple[np.ndarray, dict[str, np.ndarray], float, list[str]]:
    """Put signals with separate times on one even grid, every value held until the next."""
    steps = {role: base_step(series[role][0]) for role in ("op", "pv")}
    if Ts is None:
        known = [s for s in steps.values() if s is not None]
        if len(known) < 2 or abs(known[0] - known[1]) > _TOLERANCE * max(known):
            intervals = ", ".join(
                f"{r.upper()} {'uneven' if s is None else f'every {s:g} s'}"
                for r, s in steps.items()
            )
            raise RecordError(
                f"{where}: OP and PV have times of their own ({intervals}); say which sampling"
                " period Ts is needed"
            )
        Ts = min(known)
    grid = _grid_of(series, Ts)
    signals = {}
    notes = []
    for role, (t, x) in series.items():
        at = np.searchsorted(t, grid + _TOLERANCE * Ts, side="right") - 1
        signals[role] = last_known(grid + _TOLERANCE * Ts, t, x)
        held = float(np.mean(np.diff(at) == 0)) if at.size > 1 else 0.0
        if held > 0:
            notes.append(
                f"archive: {role.upper()} holds its last stored value in {held:.0%} of {grid.size}"
                " samples"
            )
    return grid, signals, Ts, notes

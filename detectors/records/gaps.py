"""Put samples on an even grid: bridge short gaps, split the record at long ones, refuse it if too
many samples are missing, and resample uneven times where that is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.clock import hour_lost

BRIDGED = 3  # samples; a longer hole splits the record
MOST_MISSING = 0.20  # share of a record that may be missing
# share of the record that SP and MV may cost: the part without holes of theirs is at least so long
_WORTH = 0.5
# sampling periods from one sample to the next: beyond, whole numbers no longer count them
_FURTHEST = 1e12
SHORTEST = 3  # samples of a record
_EVEN = "--resample linear"
# ways between two samples of uneven times
HELD_VALUES = "held"
STRAIGHT_LINES = "linear"
_TOLERANCE = 0.01  # of the sampling period, by which a sample may be late on an even grid
_WITH_HOLES = ("sp", "mv")  # signals that may have holes: a record can do without them
JITTER = 0.01  # deviation from Ts, as a share of it, above which time has a gap


Series = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Placed:
    """Samples counted in sampling periods: the place of each on the grid, how many places there
    are, which samples have both OP and PV, and where local time jumps by an hour.
    """

    place: np.ndarray
    size: int
    known: np.ndarray
    steps: np.ndarray  # s, from each sample to the next
    jumps: np.ndarray

    def has(self, x: np.ndarray, lo: int, hi: int) -> np.ndarray:
        """Return which samples of a signal are known and lie from place lo to hi."""
        return np.isfinite(x) & (self.place >= lo) & (self.place <= hi)


def fill_gaps(
    t: np.ndarray, signals: Mapping[str, np.ndarray], Ts: float, where: str
) -> tuple[np.ndarray, dict[str, np.ndarray], list[str]]:
    """Put the samples on an even grid, bridge short holes, keep the longest segment without a long
    one.
    """
    placed = _place(t, signals, Ts, where)
    _refuse_holes(placed, Ts, where)
    lo, hi = _choose_stretch(placed, signals)
    grid = np.arange(lo, hi + 1)
    filled: dict[str, np.ndarray] = {}
    notes: list[str] = []
    for name, x in signals.items():
        here = placed.has(x, lo, hi)
        if name in _WITH_HOLES and not _bridges(placed.place[here], lo, hi):
            if here.any():
                notes.append(
                    f"gaps: {name.upper()} has holes of more than {BRIDGED} samples and is left out"
                )
            continue
        missing = grid.size - int(here.sum())
        if name in _WITH_HOLES and missing:
            notes.append(
                f"gaps: {missing} of {grid.size} samples of {name.upper()} missing, bridged"
            )
        filled[name] = _fill(name, x[here], placed.place[here], grid)
    return grid * Ts, filled, [*_note_stretch(placed, lo, hi), *notes, *_note_clock(placed, Ts)]


def _place(t: np.ndarray, signals: Mapping[str, np.ndarray], Ts: float, where: str) -> _Placed:
    """Count samples in sampling periods from the first one."""
    steps = np.diff(t)
    longest = float(steps.max(initial=0.0))
    if not longest < _FURTHEST * Ts:
        needed = f"less than {_FURTHEST:g} of them is needed"
        raise RecordError(
            f"{where}: a time step of {longest:g} s among steps of {Ts:g} s; {needed}"
        )
    place = np.arange(t.size)
    if np.any(np.abs(steps - Ts) > JITTER * Ts):
        whole = np.maximum(np.rint(steps / Ts), 1).astype(int)
        place = np.concatenate([[0], np.cumsum(whole)])
    known = np.isfinite(signals["op"]) & np.isfinite(signals["pv"])
    return _Placed(place, int(place[-1]) + 1, known, steps, hour_lost(t, Ts))


def _refuse_holes(placed: _Placed, Ts: float, where: str) -> None:
    """Refuse a record of which too much is missing, and name the option that helps."""
    missing = placed.size - int(placed.known.sum())
    if missing <= MOST_MISSING * placed.size:
        return
    off = np.abs(placed.steps - Ts)
    jumps = placed.jumps
    # counting the samples in place of reading the clock is right only where no sample is missing
    even = np.all(np.delete(off, jumps) <= JITTER * Ts)
    if jumps.size and even and placed.known.all():
        counted = f"so that {missing} of {placed.size} samples seem to be missing"
        raise RecordError(f"{where}: {_summer_time(jumps)}, {counted}", f"--ts {Ts:g}")
    # rows at uneven times can be put on an even grid; one long hole cannot be filled
    often = placed.known.all() and np.mean(off > JITTER * Ts) > MOST_MISSING
    raise RecordError(
        f"{where}: {missing} of {placed.size} samples are missing; at most {MOST_MISSING:.0%} may"
        " be",
        _EVEN if often else "",
    )


def _choose_stretch(placed: _Placed, signals: Mapping[str, np.ndarray]) -> tuple[int, int]:
    """Return first and last place of the longest part without a long hole in OP and PV, and in SP
    and MV where that costs no more than half of it.
    """
    used = placed.known
    lo, hi = _longest(placed.place[used]) if used.any() else (0, 0)
    whole = hi - lo + 1
    for name in _WITH_HOLES:
        if name not in signals:
            continue
        both = used & np.isfinite(signals[name])
        if not both.any():
            continue
        low, high = _longest(placed.place[both])
        if high - low + 1 >= _WORTH * whole:
            used = both
            lo = low
            hi = high
            whole = hi - lo + 1
    return lo, hi


def _bridges(places: np.ndarray, lo: int, hi: int) -> bool:
    """Return whether the known places leave no hole from lo to hi that is too long to bridge."""
    holes = np.diff(np.concatenate([[lo - 1], places, [hi + 1]]))
    return places.size > 0 and bool(holes.max() <= BRIDGED + 1)


def _fill(name: str, x: np.ndarray, places: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return a signal at every place of the grid: a set point holds its value until it is changed,
    others are bridged by straight lines.
    """
    if name == "sp":
        return x[np.maximum(np.searchsorted(places, grid, side="right") - 1, 0)]
    return np.interp(grid, places, x)


def _note_stretch(placed: _Placed, lo: int, hi: int) -> list[str]:
    """Return notes on which part of the record was kept, and on what was bridged in it."""
    notes = []
    length = hi - lo + 1
    if length < placed.size:
        part = f"the longest part without a hole of more than {BRIDGED}"
        notes.append(
            f"gaps: judged samples {lo} to {hi} of {placed.size} ({length / placed.size:.0%}),"
            f" {part}"
        )
    kept = (placed.place >= lo) & (placed.place <= hi)
    if bridged := length - int(placed.known[kept].sum()):
        notes.append(f"gaps: {bridged} of {length} samples missing, bridged by straight lines")
    return notes


def _note_clock(placed: _Placed, Ts: float) -> list[str]:
    """Return notes on times that are uneven, or jump by an hour."""
    notes = []
    if placed.jumps.size:
        summer = _summer_time(placed.jumps)
        notes.append(f"time: {summer}; --ts {Ts:g} counts the samples in place of the clock")
    steps = placed.steps
    uneven = int(np.sum(np.abs(steps - np.rint(steps / Ts) * Ts) > JITTER * Ts))
    if uneven:
        often = uneven > MOST_MISSING * steps.size
        notes.append(
            f"gaps: {uneven} of {steps.size} time steps differ from Ts = {Ts:g} s by more than"
            f" {JITTER:.0%}" + (f"; {_EVEN} puts them on an even grid" if often else "")
        )
    return notes


def _summer_time(jumps: np.ndarray) -> str:
    return (
        f"local time jumps by an hour after sample {jumps[0]}, as it does when summer time begins"
    )


def _longest(places: np.ndarray) -> tuple[int, int]:
    """First and last place of the longest part without a hole that cannot be bridged."""
    ends = np.flatnonzero(np.diff(places) > BRIDGED + 1)
    first = np.concatenate([[0], ends + 1])
    last = np.concatenate([ends, [places.size - 1]])
    longest = int(np.argmax(places[last] - places[first]))
    return int(places[first[longest]]), int(places[last[longest]])


def known_samples(t: np.ndarray, x: np.ndarray) -> Series:
    """Return the samples that are known; of two at one time the later one holds."""
    known = np.isfinite(x)
    t = t[known]
    x = x[known]
    last = np.append(np.diff(t) > 0, True)[: t.size]
    return t[last], x[last]


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

"""Treat gaps in a record: bridge short ones, split the record at long ones, and refuse it if too
many samples are missing.
"""

from __future__ import annotations

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
JITTER = 0.01  # deviation from Ts, as a share of it, above which time has a gap


def fill_gaps(
    t: np.ndarray,
    signals: dict[str, np.ndarray | None],
    Ts: float,
    where: str,
):
    """Put the samples on an even grid, bridge short holes, keep the longest segment without a long
    one.
    """
    dt = np.diff(t)
    if not (longest := float(dt.max(initial=0.0))) < _FURTHEST * Ts:
        needed = f"less than {_FURTHEST:g} of them is needed"
        raise RecordError(
            f"{where}: a time step of {longest:g} s among steps of {Ts:g} s; {needed}"
        )
    if np.any(np.abs(dt - Ts) > JITTER * Ts):
        place = np.concatenate([[0], np.cumsum(np.maximum(np.rint(dt / Ts), 1).astype(int))])
    else:
        place = np.arange(t.size)
    size = int(place[-1]) + 1
    known = np.isfinite(signals["op"]) & np.isfinite(signals["pv"])
    missing = size - int(known.sum())
    lo, hi = _longest(place[known]) if known.any() else (0, 0)
    jumps = hour_lost(t, Ts)
    summer = (
        f"local time jumps by an hour after sample {jumps[0]}, as it does when summer time begins"
        if jumps.size
        else ""
    )
    if missing > MOST_MISSING * size:
        sentence = (
            f"{where}: {missing} of {size} samples are missing; at most {MOST_MISSING:.0%} may be"
        )
        # counting the samples in place of reading the clock is right only where no sample is
        # missing
        even = np.all(np.delete(np.abs(dt - Ts), jumps) <= JITTER * Ts)
        if jumps.size and even and known.all():
            counted = f"so that {missing} of {size} samples seem to be missing"
            raise RecordError(f"{where}: {summer}, {counted}", f"--ts {Ts:g}")
        # rows at uneven times can be put on an even grid; one long hole cannot be filled
        often = known.all() and np.mean(np.abs(dt - Ts) > JITTER * Ts) > MOST_MISSING
        raise RecordError(sentence, _EVEN if often else "")
    used = known
    for name in ("sp", "mv"):
        x = signals.get(name)
        both = used if x is None else used & np.isfinite(x)
        if both.any():
            low, high = _longest(place[both])
            if high - low + 1 >= _WORTH * (hi - lo + 1):
                used = both
                lo = low
                hi = high
    grid = np.arange(lo, hi + 1)
    out: dict[str, np.ndarray | None] = {}
    notes = []
    for name, x in signals.items():
        here = np.isfinite(x) & (place >= lo) & (place <= hi)
        holes = np.diff(np.concatenate([[lo - 1], place[here], [hi + 1]]))
        if name in ("sp", "mv") and (not here.any() or holes.max() > BRIDGED + 1):
            if here.any():
                notes.append(
                    f"gaps: {name.upper()} has holes of more than {BRIDGED} samples and is left out"
                )
            out[name] = None
            continue
        if name in ("sp", "mv") and here.sum() < grid.size:
            notes.append(
                f"gaps: {grid.size - int(here.sum())} of {grid.size} samples of {name.upper()}"
                " missing, bridged"
            )
        if name == "sp":  # a set point holds its value until it is changed
            out[name] = x[here][np.maximum(np.searchsorted(place[here], grid, side="right") - 1, 0)]
        else:
            out[name] = np.interp(grid, place[here], x[here])
    bridged = grid.size - int(known[(place >= lo) & (place <= hi)].sum())
    uneven = int(np.sum(np.abs(dt - np.rint(dt / Ts) * Ts) > JITTER * Ts))
    if bridged:
        notes.insert(
            0, f"gaps: {bridged} of {grid.size} samples missing, bridged by straight lines"
        )
    if grid.size < size:
        part = f"the longest part without a hole of more than {BRIDGED}"
        notes.insert(
            0, f"gaps: judged samples {lo} to {hi} of {size} ({grid.size / size:.0%}), {part}"
        )
    if jumps.size:
        notes.append(f"time: {summer}; --ts {Ts:g} counts the samples in place of the clock")
    if uneven:
        notes.append(
            f"gaps: {uneven} of {dt.size} time steps differ from Ts = {Ts:g} s by more than"
            f" {JITTER:.0%}"
            + (f"; {_EVEN} puts them on an even grid" if uneven > MOST_MISSING * dt.size else "")
        )
    return grid * Ts, out, tuple(notes)


def _longest(places: np.ndarray) -> tuple[int, int]:
    """First and last place of the longest part without a hole that cannot be bridged."""
    ends = np.flatnonzero(np.diff(places) > BRIDGED + 1)
    first = np.concatenate([[0], ends + 1])
    last = np.concatenate([ends, [places.size - 1]])
    longest = int(np.argmax(places[last] - places[first]))
    return int(places[first[longest]]), int(places[last[longest]])

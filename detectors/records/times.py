"""Read the times of samples, and put the samples on an even grid: short gaps bridged, the longest
part without a long one kept, uneven times resampled where that is asked for.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from itertools import product

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.columns import SHORTEST, TIME_UNITS, as_float, parse
from simbench.detectors.records.files import Sheet

Signals = dict[str, np.ndarray]

BRIDGED = 3  # samples; a longer hole splits the record
MOST_MISSING = 0.20  # share of a record that may be missing
JITTER = 0.01  # deviation from Ts, as a share of it, above which time has a gap
HELD_VALUES = "held"  # ways between two samples of uneven times
STRAIGHT_LINES = "linear"
CALENDAR = 1e8  # s since 1970 from which a time is one of the calendar
_FURTHEST = 1e12  # sampling periods between two samples: beyond, whole numbers no longer count them
# what a number may count since 1970, how many make a second, and the years 1999 to 2100 in seconds
_SINCE_1970 = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
_THIS_CENTURY = (9.4e8, 4.1e9)
# days of a spreadsheet (years 1968 to 2119) and of MATLAB (1965 to 2119): rising by less than this
# many seconds, a time is asked for
_DAYS = ((25_000.0, 80_000.0), (718_000.0, 774_000.0))
_DAY_STEP = 0.2
_DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%Y/%m/%d", "%Y.%m.%d") + (
    "%d-%b-%Y",
    "%d-%b-%y",
    "%d/%b/%Y",
    "%d %b %Y",
    "%d.%m.%y",
    "%d/%m/%y",
    "%m/%d/%y",
)
_CLOCKS = ("%H:%M:%S", "%H:%M:%S.%f", "%H:%M", "%I:%M:%S %p", "%I:%M:%S.%f %p", "%I:%M %p")
_FORMS = (*(f"{date} {clock}" for date, clock in product(_DATES, _CLOCKS)), *_CLOCKS)
_ZONE = re.compile(r"\s*(?:UTC|GMT|Z|CET|CEST)$|\s+[+-]\d\d:?\d\d$")
_NEEDED = "seconds, or a timestamp like 2024-05-31 14:05:00, is needed"


def read_times(table: Sheet, name: str) -> np.ndarray:
    """Return a column of times in seconds, as its numbers or stamps say; rising or falling."""
    # by what the column holds
    cells = table.columns[name]
    if isinstance(cells, list):
        t = _of_texts([str(cell).strip() for cell in cells], table, name)
    elif cells.dtype.kind == "M":
        t = _of_stamps(cells)
    else:
        t = _of_numbers(cells.astype(np.float64), table, name)

    # every sample has one
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        text = str(cells[bad[0]]).strip()[:60]
        if text in ("", "nan", "NaT", "None"):
            said = "empty"
        else:
            said = repr(text)
        raise RecordError(f"{table.where}, {table.place(bad[0])}: {name} is {said}; {_NEEDED}")
    return t


def _of_stamps(stamps: np.ndarray) -> np.ndarray:
    t = stamps.astype("datetime64[ns]").astype(np.int64) * 1e-9
    return np.where(np.isnat(stamps), np.nan, t)


def _of_numbers(t: np.ndarray, table: Sheet, name: str) -> np.ndarray:
    """Return seconds from numbers; without a unit they are seconds, unless no record counts so."""
    # in the unit that is named, or below the name
    unit = parse(name).unit or table.units.get(name, "")
    if unit and unit not in TIME_UNITS:
        raise RecordError(f"{table.where}: {name} is in {unit!r}; one of {', '.join(TIME_UNITS)}")
    scale = TIME_UNITS.get(unit, 1.0)
    if scale != 1.0:
        table.notes.append(f"time: {name} is in {unit}")
    known = t[np.isfinite(t)]
    if unit or known.size < SHORTEST:
        return t * scale

    # since 1970, or since nobody knows when
    first = float(known[0])
    step = float(np.median(np.diff(known)))
    for word, size in _SINCE_1970.items():
        if _THIS_CENTURY[0] < first / size < _THIS_CENTURY[1]:
            table.notes.append(f"time: {name} counts {word} since 1970")
            return t / size

    # Days, or a time that no calendar has
    days = 0 < step < _DAY_STEP and any(low < first < high for low, high in _DAYS)
    if days or first > _THIS_CENTURY[1]:
        said = f"{table.where}: {name} begins with {first:.15g} and rises by {step:.3g}"
        if days:
            in_days = f" s, or {step * 86400:.4g} s if it counts days"
            cure = f"--ts {step * 86400:.4g}"
        else:
            in_days = ""
            cure = "--ts SECONDS"
        raise RecordError(f"{said}{in_days}; {_NEEDED}", cure)
    return t


def _of_texts(texts: list[str], table: Sheet, name: str) -> np.ndarray:
    """Return seconds from texts that are all numbers, all ISO 8601, or all of one other form."""
    # as numbers, or as stamps of this standard
    texts = [_ZONE.sub("", text) for text in texts]
    numbers = np.array([as_float(text.replace(",", ".")) for text in texts])
    if np.isfinite(numbers).all():
        return _of_numbers(numbers, table, name)
    iso = np.array([_read_iso(text) for text in texts])
    if np.isfinite(iso).all():
        return iso

    # in every other form that the first has
    import pandas as pd

    cells = [" ".join(text.replace(",", ".").split()) for text in texts]
    forms = []
    for f in _FORMS:
        if pd.to_datetime(cells[0], format=f, errors="coerce") is not pd.NaT:
            forms.append(f)
    stamps = {form: pd.to_datetime(cells, format=form, errors="coerce") for form in forms}
    read = {}
    for f, t in stamps.items():
        read[f] = _of_stamps(t.to_numpy("datetime64[ns]"))
    whole = {form: t for form, t in read.items() if np.isfinite(t).all()}
    if not whole:
        return max(numbers, iso, *read.values(), key=lambda t: np.argmin(np.isfinite(t)))

    # day or month first: time rises without a jump of days
    rising = {form: t for form, t in whole.items() if np.all(np.diff(t) > 0)} or whole
    form = min(rising, key=lambda f: (np.ptp(rising[f]), "%p" in f and f.startswith("%d"), f))
    if any(t[0] != rising[form][0] for t in rising.values()):
        other = "day and month may stand the other way round"
        table.notes.append(f"time: {name} read as {form}; {other}")
    return rising[form]


def _read_iso(text: str) -> float:
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        return np.nan
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()


def order_rows(t: np.ndarray, signals: Signals, table: Sheet, name: str, again: bool) -> np.ndarray:
    """Return the rows in which time rises: from the last where it falls, without repeated ones;
    `again` allows a time twice, else times that do not rise are refused.
    """
    # from the end
    rows = np.arange(t.size)
    if t.size > 1 and np.all(np.diff(t) <= 0) and t[0] > t[-1]:
        table.notes.append(f"time: {name} falls; read from its end")
        rows = rows[::-1]

    # without rows that are those above once more
    twice = np.flatnonzero(np.diff(t[rows]) == 0) + 1
    for x in signals.values():
        twice = twice[np.isclose(x[rows[twice]], x[rows[twice - 1]], 0, 0, equal_nan=True)]
    if twice.size and t.size - twice.size >= SHORTEST:
        table.notes.append(f"time: {twice.size} rows that repeat the one above left out")
        rows = np.delete(rows, twice)

    # each later than the one before
    steps = np.diff(t[rows])
    if np.all(steps >= 0 if again else steps > 0):
        return rows
    k = int(np.argmin(steps >= 0 if again else steps > 0))
    was, now = (table.columns[name][row] for row in rows[k : k + 2])
    cure = ""
    if np.all(steps >= 0) and steps.any():
        # the clock is coarser than the samples, or a sample stands twice
        coarse = steps.max() <= 2 * np.median(steps[steps > 0])
        if coarse:
            cure = f"--ts {steps.mean():.4g}"
        else:
            cure = "--resample held"
    said = f"{table.where}, {table.place(rows[k + 1])}: {name} does not rise ({was}, then {now})"
    raise RecordError(f"{said}; every sample needs a later time", cure)


def resample(
    t: np.ndarray, signals: Signals, Ts: float | None, how: str, table: Sheet
) -> tuple[np.ndarray, Signals, float]:
    """Return times and signals on one even grid, of the median step where none is given, and its
    step: each value held until the next, or straight lines between them; a set point is held.
    """
    # the samples that each signal has, the later of two at one time
    series = {}
    for role, x in signals.items():
        here = np.flatnonzero(np.isfinite(x))
        here = here[np.append(np.diff(t[here]) > 0, True)[: here.size]]
        series[role] = t[here], x[here]
        if role in ("op", "pv") and here.size < SHORTEST:
            few = f"{here.size} samples of {role.upper()}; at least {SHORTEST} are needed"
            raise RecordError(f"{table.where}: {few}")

    # from where OP and PV are both known to where one ends
    (op, _), (pv, _) = series["op"], series["pv"]
    times = np.union1d(op, pv)
    if Ts is None:
        Ts = float(np.median(np.diff(times)))
    begin = max(op[0], pv[0])
    end = min(op[-1], pv[-1])
    grid = begin + Ts * np.arange(int(np.floor((end - begin) / Ts + 1e-6)) + 1)

    # a sample may be late by a part of the step
    even = {}
    for role, (at, x) in series.items():
        k = np.searchsorted(at, grid + JITTER * Ts, side="right") - 1
        if at.size:
            if how == STRAIGHT_LINES and role != "sp":
                between = np.interp(grid, at, x)
            else:
                between = x[k]
            even[role] = np.where(k >= 0, between, np.nan)
    drawn = (
        "straight lines between them" if how == STRAIGHT_LINES else "each value held until the next"
    )
    note = f"resampled: {times.size} samples at uneven times on a grid of {Ts:.4g} s, {drawn}"
    table.notes.append(f"{note}; the longest step is {np.diff(times).max():.4g} s")
    return grid, even, Ts


def fill_gaps(t: np.ndarray, signals: Signals, Ts: float, table: Sheet) -> tuple[float, Signals]:
    """Return the time of the first sample and the signals of the longest part without a long hole,
    at even times, short holes bridged by straight lines.
    """
    # the place of every sample on the grid
    steps = np.diff(t)
    if not steps.max() < _FURTHEST * Ts:
        far = f"a time step of {steps.max():g} s among steps of {Ts:g} s"
        raise RecordError(f"{table.where}: {far}; less than {_FURTHEST:g} of them is needed")
    even = np.all(np.abs(steps - Ts) <= JITTER * Ts)
    whole = np.maximum(np.rint(steps / Ts), 1).astype(int)
    if even:
        place = np.arange(t.size)
    else:
        place = np.append(0, np.cumsum(whole))
    size = int(place[-1]) + 1
    off = np.abs(steps - np.rint(steps / Ts) * Ts) > JITTER * Ts

    # the samples that have both signals
    known = np.isfinite(signals["op"]) & np.isfinite(signals["pv"])
    missing = size - int(known.sum())
    if missing > MOST_MISSING * size:
        lacks = f"{table.where}: {missing} of {size} samples are missing; at most 20% may be"
        uneven = known.all() and np.mean(np.abs(steps - Ts) > JITTER * Ts) > MOST_MISSING
        raise RecordError(lacks, "--resample linear" if uneven else "")

    # the longest part without a hole that cannot be bridged; SP and MV may cost half of it
    lo, hi = _find_longest(place[known])
    for role in signals.keys() & {"sp", "mv"}:
        both = known & np.isfinite(signals[role])
        if both.any():
            first, last = _find_longest(place[both])
        else:
            first = 0
            last = -1
        if 2 * (last - first + 1) >= hi - lo + 1:
            known = both
            lo = first
            hi = last
    grid = np.arange(lo, hi + 1)
    if grid.size < size:
        part = f"judged samples {lo} to {hi} of {size} ({grid.size / size:.0%})"
        table.notes.append(f"gaps: {part}, the longest part without a hole of more than {BRIDGED}")

    # each signal on the grid; a set point holds its value until it is changed
    filled: Signals = {}
    bridged: dict[int, list[str]] = {}
    for role, x in signals.items():
        here = np.isfinite(x) & (place >= lo) & (place <= hi)
        at = place[here]
        holes = np.diff(np.concatenate([[lo - 1], at, [hi + 1]])) - 1
        if role in ("sp", "mv") and holes.max() > BRIDGED:
            left = f"gaps: {role.upper()} has holes of more than {BRIDGED} samples and is left out"
            table.notes += [left] * bool(here.any())
            continue
        if role == "sp":
            filled[role] = x[here][np.maximum(np.searchsorted(at, grid, side="right") - 1, 0)]
        else:
            filled[role] = np.interp(grid, at, x[here])
        bridged.setdefault(int(holes.sum()), []).append(role.upper())
    for count, roles in bridged.items():
        if count:
            of = f"{count} of {grid.size} samples of {', '.join(roles)}"
            table.notes.append(f"gaps: {of} missing, bridged")
    if off.any():
        differ = f"time steps differ from Ts = {Ts:g} s by more than {JITTER:.0%}"
        often = off.mean() > MOST_MISSING
        helps = "; --resample linear puts them on an even grid" if often else ""
        table.notes.append(f"gaps: {off.sum()} of {steps.size} {differ}{helps}")
    return lo * Ts, filled


def _find_longest(places: np.ndarray) -> tuple[int, int]:
    """Return first and last place of the longest part without a hole that cannot be bridged."""
    parts = np.split(places, np.flatnonzero(np.diff(places) > BRIDGED + 1) + 1)
    longest = max(parts, key=np.ptp)
    return int(longest[0]), int(longest[-1])

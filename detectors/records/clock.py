"""Read time columns: seconds, seconds since 1970, and time stamps with day or month first."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from datetime import UTC, datetime

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.dialects import entries

_DATES = (
    "%d.%m.%Y",
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%Y/%m/%d",
    "%d-%b-%Y",
    "%d-%m-%Y",
    "%d-%b-%y",
    "%d/%m/%y",
    "%m/%d/%y",
    "%d.%m.%y",
    "%d %b %Y",
    "%d/%b/%Y",
    "%Y.%m.%d",
    "%b %d, %Y",
    "%m-%d-%Y",
    "%a %b %d %Y",
)
_CLOCKS = (
    "%H:%M:%S",
    "%I:%M:%S %p",
    "%H:%M:%S.%f",
    "%I:%M:%S.%f %p",
    "%H:%M",
    "%I:%M %p",
)
_FORMS = (*(f"{date} {clock}" for clock in _CLOCKS for date in _DATES), *_CLOCKS)
_STAMP = re.compile(r"\d{1,4}[-/.]\w{1,9}[-/.]\d{2,4}|\d:\d\d")
_ZONE = re.compile(r"\s*(?:UTC|GMT|Z|CET|CEST|MEZ|MESZ)$|\s+[+-]\d\d:?\d\d$")
_UNITS = {
    name: size
    for size, names in {
        1.0: "s, sec, second, seconds",
        1e-3: "ms, msec, milliseconds",
        1e-6: "us",
        60.0: "min, mins, minute, minutes",
        3600.0: "h, hr, hour, hours",
        86400.0: "d, day, days",
    }.items()
    for name in entries(names)
}
# what a time may count since 1970, how many make a second
_SINCE_1970 = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}
_THIS_CENTURY = (9.4e8, 4.1e9)  # s since 1970
_MOST_SECONDS = 1e10  # a time without a unit is no seconds beyond; .NET counts more
# days of a spreadsheet (years 1968 to 2119) and of MATLAB (1965 to 2119)
_DAYS = ((25_000.0, 80_000.0), (718_000.0, 774_000.0))
_DAY_STEP = 0.2  # s; a sampling period below, in a time that may count days, is asked for
CALENDAR = 1e8  # s since 1970 from which a time is one of the calendar
_HOUR = 3600.0  # s by which clocks are set forward in spring, and back in autumn
_REGULAR = 0.01  # of the usual step that one may differ
_MOSTLY = 0.8  # of the steps must not differ more
_FEW_ALIKE = 0.01  # share of times given twice, up to which the clock is as fine as the samples
_NEEDED = "seconds, or a timestamp like 2024-05-31 14:05:00, is needed"
_COUNT = "--ts SECONDS"  # counts the samples in place of the clock


def seconds(
    values: list | np.ndarray,
    name: str,
    where: str,
    *,
    unit: str = "",
    place: Callable[[int], str] = lambda row: f"line {row + 2}",
    notes: list[str] | None = None,
    again: bool = False,
    signals: Mapping[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Return a time column in seconds, from numbers or time stamps; falling where the newest comes
    first.

    `again` allows a time twice; `signals` of the same rows show which of them are repeated.
    """
    remarks = notes if notes is not None else []
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        t = values.astype("datetime64[ns]").astype(np.int64) * 1e-9
        t[np.isnat(values)] = np.nan
    elif isinstance(values, np.ndarray) and values.dtype.kind in "fiu":
        t = _seconds_from_numbers(values.astype(np.float64), unit, name, where, remarks)
    else:
        t = _read_texts([str(v).strip() for v in values], unit, name, where, place, remarks)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        given = str(values[bad[0]]).strip()[:60]
        raise RecordError(
            f"{where}, {place(bad[0])}: {name} is {given!r}; every sample needs its time, a"
            " finite one"
        )
    step = np.diff(t)
    if t.size > 2 and np.all(step <= 0 if again else step < 0) and t[0] > t[-1]:
        remarks.append(f"time: {name} falls; read from its end")
        return t
    back = np.flatnonzero(step < 0 if again else step <= 0)
    if back.size:
        was = values[back[0]]
        now = values[back[0] + 1]
        why, cure, to_do = _in_what_order(t, back, signals or {})
        raise RecordError(
            f"{where}, {place(back[0] + 1)}: {name} does not rise ({was}, then {now}){why}; every"
            f" sample needs a later time{to_do}",
            "" if again else cure,
        )
    return t


def _in_what_order(
    t: np.ndarray, back: np.ndarray, signals: Mapping[str, np.ndarray]
) -> tuple[str, str, str]:
    """Return why times do not rise after the rows `back`, the option that reads the file rightly,
    and what to do to the file; empty where that is not known.

    To count the rows in place of the clock is right only where they stand in their order.
    """
    step = np.diff(t)
    order = np.argsort(t, kind="stable")
    apart = np.diff(t[order])
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 0.0
    count = f"--ts {usual:g}"
    if not np.any(step < 0):
        if back.size <= _FEW_ALIKE * step.size:
            return "", count, ""
        # the clock is coarser than the samples, or rows are repeated, or missing
        coarse = 0.0 < step.max() <= 2.0 * usual
        counted = f"--ts {float((t[-1] - t[0]) / step.size):.4g}"
        return "", counted if coarse else "--resample held", ""
    in_order = np.mean(np.abs(step - usual) <= _REGULAR * usual) > _MOSTLY
    if in_order and t[0] > CALENDAR and abs(step[back[0]] - usual + _HOUR) < usual:
        return ": local time is set back by an hour", count, ""
    if apart.min() > 0.5 * float(np.median(apart)):  # a clock set back gives times twice
        return ": rows are out of order", "", "; sort them by time"
    first = order[:-1][apart == 0]
    second = order[1:][apart == 0]
    alike = [np.array_equal(x[first], x[second], equal_nan=True) for x in signals.values()]
    if first.size and alike and all(alike):
        return ": rows are repeated", "", "; remove these and sort the others by time"
    return "", count if in_order else "", ""


def is_stamped(cells: list | np.ndarray) -> bool:
    """Whether a column begins with a time stamp."""
    if isinstance(cells, np.ndarray):
        return cells.dtype.kind == "M"
    first = next((str(c).strip() for c in cells if c is not None and str(c)), "")
    return bool(_STAMP.search(first))


def hour_lost(t: np.ndarray, Ts: float) -> np.ndarray:
    """Return the samples after which local time jumps by an hour at a full hour, as it does when
    summer time begins.
    """
    late = np.abs(np.diff(t) - Ts - _HOUR) < 0.5 * Ts
    full_hour = np.ceil(t[1:] / _HOUR) * _HOUR - t[1:]
    return np.flatnonzero(
        late & (np.minimum(full_hour, _HOUR - full_hour) < Ts) & (t[:-1] > CALENDAR)
    )


def _seconds_from_numbers(
    t: np.ndarray, unit: str, name: str, where: str, notes: list[str]
) -> np.ndarray:
    """Return seconds from numbers; without a unit they are seconds, unless no record could count
    so.
    """
    if unit:
        if unit not in _UNITS:
            raise RecordError(
                f"{where}: {name} is in {unit!r}; known units of time: {', '.join(_UNITS)}"
            )
        if _UNITS[unit] != 1.0:
            notes.append(f"time: {name} is in {unit}")
        return t * _UNITS[unit]
    finite = t[np.isfinite(t)]
    if finite.size < 2 or re.split(r"[^a-z]+", name.lower())[-1] in ("s", "sec", "seconds"):
        return t
    least = float(finite.min())
    most = float(finite.max())
    for word, size in _SINCE_1970.items():
        if _THIS_CENTURY[0] < least / size and most / size < _THIS_CENTURY[1]:
            notes.append(f"time: {name} counts {word} since 1970")
            return t / size
    if least > _MOST_SECONDS:
        raise RecordError(f"{where}: {name} begins with {finite[0]:.15g}; {_NEEDED}", _COUNT)
    step = float(np.median(np.diff(finite)))
    if 0 < step < _DAY_STEP and any(first < least and most < last for first, last in _DAYS):
        days = f"{step:.3g} s, or {step * 86400:.3g} s if it counts days; {_NEEDED}"
        raise RecordError(f"{where}: {name} rises by {days}", _COUNT)
    return t


def _read_texts(
    texts: list[str],
    unit: str,
    name: str,
    where: str,
    place: Callable[[int], str],
    notes: list[str],
) -> np.ndarray:
    """Read a column of texts: as a whole it decides between numbers, day first and month first."""
    if texts and _ZONE.search(texts[0]):
        texts = [_ZONE.sub("", text) for text in texts]
    numbers = _read_by_rule(_number, texts)
    if np.isfinite(numbers).all():
        return _seconds_from_numbers(numbers, unit, name, where, notes)
    iso = _read_by_rule(_iso, texts)
    if np.isfinite(iso).all():
        return iso
    stamps = _stamps(texts)
    whole = {form: t for form, t in stamps.items() if np.isfinite(t).all()}
    if whole:
        return _likeliest(whole, name, notes)
    reading = max((numbers, iso, *stamps.values()), key=_furthest)
    row = _furthest(reading)
    step = float(np.median(np.diff(reading[:row]))) if row > 1 else np.nan
    # rows that begin with the newest must not be counted, nor such as are no samples
    samples = all(re.search(r"\d", text) for text in texts)
    cure = "" if step <= 0 or not samples else f"--ts {step:g}" if step > 0 else _COUNT
    raise RecordError(f"{where}, {place(row)}: {name} is {texts[row]!r}; {_NEEDED}", cure)


def _read_by_rule(read: Callable[[str], float], texts: list[str]) -> np.ndarray:
    """Return the times of texts, NaN where they are none, and all NaN where the first is none."""
    begins = not texts or np.isfinite(read(texts[0]))
    return np.array([read(text) for text in texts] if begins else [np.nan] * len(texts))


def _furthest(t: np.ndarray) -> int:
    """Return the first row that a reading does not understand."""
    return int(np.argmax(~np.isfinite(t)))


def _number(text: str) -> float:
    try:
        # which Python reads as nothing, and no plant writes
        return float(text.replace(",", ".")) if "_" not in text else np.nan
    except ValueError:
        return np.nan


def _iso(text: str) -> float:
    try:
        stamp = datetime.fromisoformat(text)
    except ValueError:
        return np.nan
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()


def _stamps(texts: list[str]) -> dict[str, np.ndarray]:
    """Return the times of texts in every form that the first of them has, NaN where another has
    not.
    """
    import pandas as pd

    cells = pd.Series([" ".join(text.split()) for text in texts])
    out = {}
    decimal = cells.str.replace(",", ".")
    for form in _FORMS:
        written = decimal if "%f" in form else cells
        if not pd.isna(pd.to_datetime(written.iloc[0], format=form, errors="coerce")):
            t = pd.to_datetime(written, format=form, errors="coerce").to_numpy("datetime64[ns]")
            out[form] = np.where(np.isnat(t), np.nan, t.astype(np.int64) * 1e-9)
    return out


def _likeliest(whole: dict[str, np.ndarray], name: str, notes: list[str]) -> np.ndarray:
    """Choose between readings: where they differ in their steps, time that rises without a jump of
    days decides.
    """
    rising = {f: t for f, t in whole.items() if np.all(np.diff(t) > 0)} or whole
    form = min(rising, key=lambda f: (float(rising[f][-1] - rising[f][0]), f))
    if not all(np.allclose(np.diff(t), np.diff(rising[form])) for t in rising.values()):
        notes.append(
            f"time: {name} read as {form}, as any other order of day and month leaves holes of days"
        )
        return rising[form]
    # who writes AM and PM writes the month first
    form = next((f for f in rising if f.startswith("%m") and "%p" in f), form)
    if any(t[0] != rising[form][0] for t in rising.values()):
        notes.append(f"time: {name} read as {form}; day and month may stand the other way round")
    return rising[form]

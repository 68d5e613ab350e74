"""Time columns: seconds, time stamps with day or month first, AM and PM, and what spreadsheets and computers count in."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import takewhile

import numpy as np

from detectors.errors import RecordError

DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%d-%b-%Y", "%d-%m-%Y", "%d-%b-%y", "%d/%m/%y", "%m/%d/%y")
CLOCKS = ("%H:%M:%S", "%I:%M:%S %p", "%H:%M:%S.%f", "%I:%M:%S.%f %p", "%H:%M", "%I:%M %p")
UNITS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "milliseconds": 1e-3, "us": 1e-6,
    "min": 60.0, "mins": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0, "hr": 3600.0, "hour": 3600.0, "hours": 3600.0,
    "d": 86400.0, "day": 86400.0, "days": 86400.0,
}  # fmt: skip
EPOCHS = ((1e17, 1e-9, "nanoseconds"), (1e14, 1e-6, "microseconds"), (1e11, 1e-3, "milliseconds"))
SHEET_DAYS = (25_000.0, 80_000.0)  # days since 1900 in which a spreadsheet counts the years 1968 to 2119
MATLAB_DAYS = (718_000.0, 774_000.0)  # days since year 0 in which MATLAB counts the years 1965 to 2119
DAY_STEP, SECOND_STEP = 0.002, 0.2  # steps below the first are days (173 s), above the second seconds; between: refused


def seconds(
    values: list | np.ndarray,
    name: str,
    where: str,
    *,
    unit: str = "",
    place: Callable[[int], str] = lambda row: f"line {row + 2}",
    notes: list[str] | None = None,
) -> np.ndarray:
    """Return a time column in seconds, from numbers or time stamps.

    Parameters
    ----------
    values : list or ndarray
        Cells: numbers, ISO time stamps, or a date of `DATES` and a clock of `CLOCKS`.
    name, where : str
        Column and file, for messages.
    unit : str
        What the header says that numbers count in; "" = seconds, unless they can only be something else.
    place : function of row to str
        Where a row stands in its file.
    notes : list of str, optional
        Takes what had to be assumed.

    Returns
    -------
    ndarray, shape (n,)
        Strictly rising.

    Raises
    ------
    RecordError
        With the line, for a missing or unreadable time, time that does not rise, and time that can be read in two ways.

    Examples
    --------
    >>> t = seconds(["2024-05-31 14:05:00", "2024-05-31 14:05:10"], "time", "FIC101.csv")
    >>> float(t[1] - t[0])
    10.0
    >>> seconds(["5/31/2024 11:59:58 PM", "6/1/2024 12:00:00 AM"], "time", "FIC101.csv")[1] % 86400
    np.float64(0.0)
    """
    said = notes if notes is not None else []
    if isinstance(values, np.ndarray) and values.dtype.kind == "M":
        t = values.astype("datetime64[ns]").astype(np.int64) * 1e-9
        t[np.isnat(values)] = np.nan
    elif isinstance(values, np.ndarray) and values.dtype.kind in "fiu":
        t = _counted(values.astype(np.float64), unit, name, where, said)
    else:
        t = _read([str(v).strip() for v in values], unit, name, where, place, said)
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        given = str(values[bad[0]]).strip()[:60]
        raise RecordError(f"{where}, {place(bad[0])}: {name} is {given!r}; every sample needs its time, a finite one")
    back = np.flatnonzero(np.diff(t) <= 0)
    if back.size:
        was, now = values[back[0]], values[back[0] + 1]
        said = f"{name} does not rise ({was}, then {now}); every sample needs a later time"
        raise RecordError(f"{where}, {place(back[0] + 1)}: {said}")
    return t


def _counted(t: np.ndarray, unit: str, name: str, where: str, notes: list[str]) -> np.ndarray:
    """Return seconds from numbers; without a unit they are seconds, unless no record could count so."""
    if unit:
        if unit not in UNITS:
            raise RecordError(f"{where}: {name} is in {unit!r}; known units of time: {', '.join(UNITS)}")
        if UNITS[unit] != 1.0:
            notes.append(f"time: {name} is in {unit}")
        return t * UNITS[unit]
    finite = t[np.isfinite(t)]
    if finite.size < 2 or re.split(r"[^a-z]+", name.lower())[-1] in ("s", "sec", "seconds"):
        return t
    for least, size, word in EPOCHS:
        if finite.min() > least:
            notes.append(f"time: {name} counts {word} since 1970")
            return (t - finite[0]) * size
    step = float(np.median(np.diff(finite)))
    for (first, last), whose in ((SHEET_DAYS, "of a spreadsheet"), (MATLAB_DAYS, "of MATLAB")):
        if first < finite.min() and finite.max() < last and 0 < step < SECOND_STEP:
            if step > DAY_STEP:
                both = f"{step:.3g} s, or {step * 86400:.3g} s if it counts the days {whose}"
                raise RecordError(f"{where}: {name} rises by {both}; name the column t_s, or write time stamps")
            notes.append(f"time: {name} counts the days {whose}")
            return np.round((t - finite[0]) * 86400.0, 3)
    return t


def _forms() -> list[str]:
    return ["iso", *(f"{date} {clock}" for clock in CLOCKS for date in DATES), *CLOCKS]


def _read(texts: list[str], unit: str, name: str, where: str, place: Callable[[int], str], notes: list[str]) -> np.ndarray:
    """Read a column of texts: as a whole it decides between numbers, day first and month first."""
    plain = list(takewhile(lambda x: x is not None, (_time(text, "number") for text in texts)))
    if len(plain) == len(texts):
        return _counted(np.array(plain, dtype=float), unit, name, where, notes)
    furthest, whole = len(plain), {}
    for form in [f for f in _forms() if _time(texts[0], f) is not None]:
        t = list(takewhile(lambda x: x is not None, (_time(text, form) for text in texts)))
        furthest = max(furthest, len(t))
        if len(t) == len(texts):
            whole[form] = np.array(t, dtype=float)
    if not whole:
        needed = "seconds, or a timestamp like 2024-05-31 14:05:00, is needed"
        raise RecordError(f"{where}, {place(furthest)}: {name} is {texts[furthest]!r}; {needed}")
    return _likeliest(whole, name, where, notes)


def _likeliest(whole: dict[str, np.ndarray], name: str, where: str, notes: list[str]) -> np.ndarray:
    """Choose between readings: where they differ in their steps, time that rises without a jump of days decides."""
    rising = {f: t for f, t in whole.items() if np.all(np.diff(t) > 0)} or whole
    spans = sorted((float(t[-1] - t[0]), f) for f, t in rising.items())
    form = spans[0][1]
    others = [f for s, f in spans[1:] if not np.allclose(np.diff(rising[f]), np.diff(rising[spans[0][1]]))]
    if others:
        largest = [float(np.diff(rising[f]).max()) for f in (form, others[0])]
        if largest[0] > 0.1 * largest[1]:
            raise RecordError(f"{where}: {name} can be read as {form} and as {others[0]}; write dates as 2024-05-31")
        notes.append(f"time: {name} read as {form}, as any other order of day and month leaves holes of days")
    return rising[form]


def _time(text: str, form: str) -> float | None:
    try:
        if form == "number":
            return float(text.replace(",", "."))
        if form == "iso":
            stamp = datetime.fromisoformat(text)
        else:
            stamp = datetime.strptime(text.replace(",", ".") if "%f" in form else text, form)
    except ValueError:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()

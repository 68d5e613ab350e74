"""Read time columns: seconds, time stamps with day or month first, AM and PM, and the day counts of
spreadsheets.
"""

from __future__ import annotations

import re
from calendar import month_abbr
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from itertools import takewhile

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.dialects import entries
from simbench.detectors.records.roles import plain

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
    "%Y-%m-%d",
    "%d %b %Y",
    "%d. %b %Y",
    "%d/%b/%Y",
    "%Y.%m.%d",
    "%b %d, %Y",
    "%Y年%m月%d日",
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
    "%H:%M:%S:%f",
)
_COMPACT = "%Y%m%d%H%M%S"
_FORMS = ("iso", *(f"{date} {clock}" for clock in _CLOCKS for date in _DATES), *_CLOCKS, _COMPACT)
_ZONE = re.compile(r"\s*(?:UTC|GMT|Z|CET|CEST|MEZ|MESZ)$|\s+[+-]\d\d:?\d\d$")
# months of other languages, by their first letters without accents
_MONTHS = {
    begins: month
    for month, beginnings in {
        "Jan": "janv, ene, gen",
        "Feb": "fev",
        "Mar": "mar, mrz, maerz",
        "Apr": "avr, abr",
        "May": "mai, mag",
        "Jun": "juin, giu",
        "Jul": "juil, lug",
        "Aug": "aou, ago",
        "Sep": "set, sept",
        "Oct": "okt, ott",
        "Dec": "dez, dic",
    }.items()
    for begins in entries(beginnings)
}
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
# counts from which a time is one of these, how many make a second, and how many seconds before 1970
# they begin
_EPOCHS = (
    (7e17, 1e9, 0.0, "nanoseconds since 1970"),
    (6e17, 1e7, 62_135_596_800.0, "ticks of .NET"),
    (1e17, 1e7, 11_644_473_600.0, "ticks of Windows since 1601"),
    (1e14, 1e6, 0.0, "microseconds since 1970"),
    (1e11, 1e3, 0.0, "milliseconds since 1970"),
)
_SHEET_DAYS = (
    25_000.0,
    80_000.0,
)  # days since 1900 in which a spreadsheet counts the years 1968 to 2119
_MATLAB_DAYS = (
    718_000.0,
    774_000.0,
)  # days since year 0 in which MATLAB counts the years 1965 to 2119
_DAY_1970 = {"of a spreadsheet": 25_569.0, "of MATLAB": 719_529.0}
# the second that is now and then added to the last minute of a day
_LEAP = re.compile(r"(?<=:59:)60(?!\d)")
CALENDAR = 1e8  # s since 1970 from which a time is one of the calendar
_HOUR = 3600.0  # s by which clocks are set forward in spring, and back in autumn
_REGULAR, _MOSTLY = 0.01, 0.8  # of the usual step that one may differ, and how many steps must not
_FEW_ALIKE = 0.01  # share of times given twice, up to which the clock is as fine as the samples
_LONG = 5000  # rows from which a column of time stamps is read as a whole
_DAY_STEP, _SECOND_STEP = (
    0.002,
    0.2,
)  # steps below the first are days (173 s), above the second seconds; between: refused


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
        t = _counted(values.astype(np.float64), unit, name, where, remarks)
    else:
        t = _read([str(v).strip() for v in values], unit, name, where, place, remarks)
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
        was, now = values[back[0]], values[back[0] + 1]
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
    step, order = np.diff(t), np.argsort(t, kind="stable")
    apart = np.diff(t[order])
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 0.0
    count = f"--ts {usual:g}"
    if not np.any(step < 0):
        if back.size <= _FEW_ALIKE * step.size:
            return "", count, ""
        # the clock is coarser than the samples, or rows are repeated, or missing
        coarse = 0.0 < step.max() <= 2.0 * usual
        return "", f"--ts {float((t[-1] - t[0]) / step.size):g}" if coarse else "", ""
    in_order = np.mean(np.abs(step - usual) <= _REGULAR * usual) > _MOSTLY
    if in_order and t[0] > CALENDAR and abs(step[back[0]] - usual + _HOUR) < usual:
        return ": local time is set back by an hour", count, ""
    if apart.min() > 0.5 * float(np.median(apart)):  # a clock set back gives times twice
        return ": rows are out of order", "", "; sort them by time"
    first, second = order[:-1][apart == 0], order[1:][apart == 0]
    alike = [np.array_equal(x[first], x[second], equal_nan=True) for x in signals.values()]
    if first.size and alike and all(alike):
        return ": rows are repeated", "", "; remove these and sort the others by time"
    return "", count if in_order else "", ""


def hour_lost(t: np.ndarray, Ts: float) -> np.ndarray:
    """Return the samples after which local time jumps by an hour at a full hour, as it does when
    summer time begins.
    """
    late = np.abs(np.diff(t) - Ts - _HOUR) < 0.5 * Ts
    full_hour = np.ceil(t[1:] / _HOUR) * _HOUR - t[1:]
    return np.flatnonzero(
        late & (np.minimum(full_hour, _HOUR - full_hour) < Ts) & (t[:-1] > CALENDAR)
    )


def _counted(t: np.ndarray, unit: str, name: str, where: str, notes: list[str]) -> np.ndarray:
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
    for least, a_second, before, word in _EPOCHS:
        if finite.min() > least:
            notes.append(f"time: {name} counts {word}")
            return t / a_second - before
    step = float(np.median(np.diff(finite)))
    for (first, last), whose in ((_SHEET_DAYS, "of a spreadsheet"), (_MATLAB_DAYS, "of MATLAB")):
        if first < finite.min() and finite.max() < last and 0 < step < _SECOND_STEP:
            if step > _DAY_STEP:
                both = f"{step:.3g} s, or {step * 86400:.3g} s if it counts the days {whose}"
                raise RecordError(
                    f"{where}: {name} rises by {both}; name the column t_s, or write time stamps"
                )
            notes.append(f"time: {name} counts the days {whose}")
            return np.round((t - _DAY_1970[whose]) * 86400.0, 3)
    return t


def _read(
    texts: list[str],
    unit: str,
    name: str,
    where: str,
    place: Callable[[int], str],
    notes: list[str],
) -> np.ndarray:
    """Read a column of texts: as a whole it decides between numbers, day first and month first."""
    texts = (
        [_ZONE.sub("", text) for text in texts]
        if _ZONE.search(texts[0] if texts else "")
        else texts
    )
    if texts and re.search(r"[^\W\d_]{3,}", texts[0]):
        texts = [re.sub(r"[^\W\d_]{3,}\.?", _month, text) for text in texts]
    leap = np.array([":59:60" in text for text in texts])
    if leap.any():
        notes.append(f"time: the leap second of {name} is read as a second of its own")
        t = _read([_LEAP.sub("59", text) for text in texts], unit, name, where, place, notes)
        begins = np.diff(leap if t[0] <= t[-1] else leap[::-1], prepend=False) & (
            leap if t[0] <= t[-1] else leap[::-1]
        )
        added = np.cumsum(begins)
        return t + (added if t[0] <= t[-1] else added[::-1])
    counted = (
        "number" if not re.fullmatch(r"(19|20)\d{12}", texts[0] if texts else "") else _COMPACT
    )
    plain = list(takewhile(lambda x: x is not None, (_time(text, counted) for text in texts)))
    if len(plain) == len(texts):
        return _counted(np.array(plain, dtype=float), unit, name, where, notes)
    furthest, whole = len(plain), {}
    forms = [f for f in _FORMS if _time(texts[0], f) is not None]
    for form in forms:
        if (fast := _at_once(texts, form)) is not None:
            whole[form] = fast
            if form == "iso":  # no other form begins with the year and a dash
                break
    for form in () if whole else forms:
        t = list(takewhile(lambda x: x is not None, (_time(text, form) for text in texts)))
        furthest = max(furthest, len(t))
        if len(t) == len(texts):
            whole[form] = np.array(t, dtype=float)
            if form == "iso":
                break
    if not whole:
        needed = "seconds, or a timestamp like 2024-05-31 14:05:00, is needed"
        raise RecordError(f"{where}, {place(furthest)}: {name} is {texts[furthest]!r}; {needed}")
    return _likeliest(whole, name, where, notes)


def _likeliest(whole: dict[str, np.ndarray], name: str, where: str, notes: list[str]) -> np.ndarray:
    """Choose between readings: where they differ in their steps, time that rises without a jump of
    days decides.
    """
    rising = {f: t for f, t in whole.items() if np.all(np.diff(t) > 0)} or whole
    spans = sorted((float(t[-1] - t[0]), f) for f, t in rising.items())
    form = spans[0][1]
    others = [
        f for s, f in spans[1:] if not np.allclose(np.diff(rising[f]), np.diff(rising[spans[0][1]]))
    ]
    if others:
        largest = [float(np.diff(rising[f]).max()) for f in (form, others[0])]
        if largest[0] > 0.1 * largest[1]:
            sentence = (
                f"{where}: {name} can be read as {form} and as {others[0]}; write dates as"
                " 2024-05-31"
            )
            raise RecordError(sentence, f"--ts {float(np.median(np.diff(rising[form]))):g}")
        notes.append(
            f"time: {name} read as {form}, as any other order of day and month leaves holes of days"
        )
        return rising[form]
    # who writes AM and PM writes the month first
    form = next((f for f in rising if f.startswith("%m") and "%p" in f), form)
    if any(t[0] != rising[form][0] for t in rising.values()):
        notes.append(f"time: {name} read as {form}; day and month may stand the other way round")
    return rising[form]


def _month(match: re.Match) -> str:
    word = plain(match[0].rstrip("."))
    if word[:3].capitalize() in month_abbr:
        return word[:3].capitalize()
    return next((month for begins, month in _MONTHS.items() if word.startswith(begins)), match[0])


def _at_once(texts: list[str], form: str) -> np.ndarray | None:
    """Read a long column as a whole where that is the same as cell by cell; None where it cannot
    be.
    """
    if len(texts) < _LONG:
        return None
    import pandas as pd

    cells = pd.Series(texts).str.replace(",", ".") if "%f" in form else pd.Series(texts)
    try:
        stamps = pd.to_datetime(cells, format="ISO8601" if form == "iso" else form, utc=True)
    except (ValueError, OverflowError):
        return None
    return (
        None if stamps.hasnans else stamps.to_numpy(dtype="datetime64[ns]").astype(np.int64) * 1e-9
    )


def _time(text: str, form: str) -> float | None:
    try:
        if form == "number":
            return float(text.replace(",", ".")) if "_" not in text else None
        if form == "iso":
            stamp = datetime.fromisoformat(text)
        else:
            stamp = datetime.strptime(text.replace(",", ".") if "%f" in form else text, form)
    except ValueError:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()

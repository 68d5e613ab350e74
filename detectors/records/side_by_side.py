"""The signals of one loop put side by side on common times, from a column each or from times of
their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from shlex import quote

import numpy as np

from simbench.detectors.errors import RecordError, printable
from simbench.detectors.records.archive import (
    Series,
    base_step,
    hold,
    last_known,
    resample,
    stored_on_change,
)
from simbench.detectors.records.clock import seconds
from simbench.detectors.records.dialects import words
from simbench.detectors.records.gaps import BRIDGED, JITTER, MOST_MISSING, SHORTEST
from simbench.detectors.records.historian import read_numbers
from simbench.detectors.records.long_table import is_stamped, read_series
from simbench.detectors.records.mode import mode
from simbench.detectors.records.opened import OpenedTable
from simbench.detectors.records.quality_column import apply_quality
from simbench.detectors.records.roles import MODE, SIGNALS, find_time
from simbench.detectors.records.tables import rises


def _unknown_modes(cells: Sequence[object] | np.ndarray, modes: np.ndarray) -> list[str]:
    """Return a note on the words that are no mode, if some are: the mode before them is held."""
    said = ("" if c is None or c != c else str(c).strip() for c in cells)
    odd = Counter(text for text, known in zip(said, modes, strict=True) if text and not known)
    if not odd or not (modes != "").any():
        return []
    (word, _), *_ = odd.most_common(1)
    return [
        f"mode: {odd.total()} samples say {printable(word)!r}, which is no mode known here; the"
        " mode before them is taken to last"
    ]


def read_wide(
    table: OpenedTable,
    roles: dict[str, str],
    chosen: Mapping[str, str],
    Ts: float | None,
    how: str | None = None,
):
    """Read a table with a column per signal: times, signals (NaN where unknown), modes, and the
    sampling period where it is given; `how` its samples are put on an even grid, if they are.
    """
    sheet = table.sheet
    where = table.where
    read = read_numbers(sheet, [roles[s] for s in SIGNALS if s in roles], where)
    signals = {s: read[roles[s]] for s in SIGNALS if s in roles}
    apply_quality(sheet, roles, signals, where, chosen)
    n = signals["pv"].size
    if n < SHORTEST:
        raise RecordError(f"{where}: {n} samples; at least {SHORTEST} are needed")
    modes = None
    if MODE in roles:
        cells = sheet.columns[roles[MODE]]
        modes = mode(cells)
        sheet.notes += _unknown_modes(cells, modes)
    if Ts is not None and how is None:
        return np.arange(n) * float(Ts), signals, modes, Ts
    name = find_time(list(sheet.columns), chosen, where)
    if name is None:
        free = {n: cells for n, cells in sheet.columns.items() if n not in roles.values()}
        name = next((n for n, cells in free.items() if is_stamped(cells)), None)
        sheet.notes += [] if name is None else [f"time: {name!r} holds time stamps"]
    if name is None:
        names = ", ".join(words("time")[:6])
        sentence = (
            f"{where}: no time column ({names}) and no sampling period Ts given; either is needed"
        )
        clocks = [n for n, cells in sheet.columns.items() if rises(cells)]
        signal = {n: role.upper() for role, n in roles.items()}
        if clocks and clocks[0] in signal:
            wrong = (
                f"{clocks[0]!r}, given as {signal[clocks[0]]}, rises from row to row as time does"
            )
            raise RecordError(f"{sentence}; {wrong}")
        raise RecordError(sentence, f"--columns t={quote(clocks[0])}" if clocks else "--ts 1")
    # where every row holds the value of one signal, the next may have the same time
    apart = not np.any(np.isfinite(signals["op"]) & np.isfinite(signals["pv"]))
    t = seconds(
        sheet.columns[name],
        name,
        where,
        unit=table.units.get(name, ""),
        place=sheet.place,
        notes=sheet.notes,
        again=apart or how is not None,
        signals=signals,
    )
    if t[0] > t[-1]:
        t = t[::-1]
        signals = {role: x[::-1] for role, x in signals.items()}
        modes = None if modes is None else modes[::-1]
    if not apart and how is None:
        return t, signals, modes, None
    series = {role: known_samples(t, x) for role, x in signals.items()}
    times, signals, Ts = _align_signals(series, Ts, where, sheet.notes, how)
    modes = modes if modes is None else last_known(times, t, modes, "")
    return times, signals, modes, Ts


def known_samples(t: np.ndarray, x: np.ndarray) -> Series:
    """Return the samples that are known; of two at one time the later one holds."""
    known = np.isfinite(x)
    t = t[known]
    x = x[known]
    last = np.append(np.diff(t) > 0, True)[: t.size]
    return t[last], x[last]


def read_long(
    table: OpenedTable,
    roles: dict[str, str],
    chosen: Mapping[str, str],
    Ts: float | None,
    how: str | None = None,
):
    """Read a table whose signals have separate times, as `read_wide` does another."""
    parts = {role: (table.parts or {})[name] for role, name in roles.items()}
    where = table.where
    series = {role: read_series(part, role, where, chosen) for role, part in parts.items()}
    stored = series.pop(MODE, None)
    notes: list[str] = []
    t, signals, given = _align_signals(series, Ts, where, notes, how)
    modes = None if stored is None else last_known(t, *stored, "")
    table.sheet.notes += [note for part in parts.values() for note in part.notes] + notes
    return t, signals, modes, given


def _align_signals(
    series: Mapping[str, Series],
    Ts: float | None,
    where: str,
    remarks: list[str],
    how: str | None = None,
):
    """Put signals with separate times side by side; returns also the sampling period, where it was
    needed to do so.
    """
    for role in ("op", "pv"):
        if series[role][0].size < SHORTEST:
            raise RecordError(
                f"{where}: {series[role][0].size} samples of {role.upper()}; at least {SHORTEST}"
                " are needed"
            )
    if how is not None:
        known = {role: one for role, one in series.items() if one[0].size}
        t, signals, Ts, note = resample(known, Ts, how)
        remarks.append(note)
        return t, signals, Ts
    times = np.unique(np.concatenate([series["op"][0], series["pv"][0]]))
    step = base_step(times)
    least = min(series[r][0].size for r in ("op", "pv"))
    full = step is not None and least * step > (1 - MOST_MISSING) * (times[-1] - times[0])
    # logged together at even times: what lies between is a gap, over which no value holds
    together = least > (1 - MOST_MISSING) * times.size and all(
        _regular(series[r][0]) for r in ("op", "pv")
    )
    full = full or (step is not None and together)
    if Ts is None and (full or is_on_change(times, series)):
        signals = {role: _at(times, *series[role]) for role in ("op", "pv")}
        signals |= {
            role: last_known(times, *series[role])
            for role in ("sp", "mv")
            if role in series and series[role][0].size
        }
        return times, signals, None
    uneven = [
        r for r in ("op", "pv") if not _regular(series[r][0]) and not stored_on_change(*series[r])
    ]
    if Ts is None and uneven:
        usual = float(np.median(np.diff(series["pv"][0])))
        sentence = (
            f"{where}: times of {' and '.join(uneven).upper()} are uneven; say which sampling"
            " period Ts to use"
        )
        raise RecordError(sentence, f"--ts {usual:.3g}")
    t, signals, step, notes = hold(series, Ts, where)
    remarks += notes or [
        "archive: OP and PV have times of their own; OP is the last value before each PV"
    ]
    return t, signals, step


def _at(times: np.ndarray, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    out = np.full(times.size, np.nan)
    out[np.searchsorted(times, t)] = x
    return out


def _regular(t: np.ndarray) -> bool:
    dt = np.diff(t)
    return bool(np.mean(np.abs(dt - np.median(dt)) <= JITTER * np.median(dt)) > 1 - MOST_MISSING)


def is_on_change(t: np.ndarray, series: Mapping[str, Series]) -> bool:
    """Whether what is missing of OP and PV is missing because it had not changed."""
    step = base_step(t)
    if step is None or not {"op", "pv"} <= set(series):
        return False
    size = round((t[-1] - t[0]) / step) + 1
    sparse = []
    for role in ("op", "pv"):
        when = series[role][0]
        if (
            when.size < (1 - MOST_MISSING) * size
            or np.diff(when).max(initial=0.0) > (BRIDGED + 1.5) * step
        ):
            sparse.append(role)
    return bool(sparse) and all(stored_on_change(*series[role]) for role in sparse)

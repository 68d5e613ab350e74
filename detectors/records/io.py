"""Loaders: CSV, parquet, Excel and ISDB .mat files become LoopRecords; every bad file is one clear sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from detectors.errors import RecordError, nearest
from detectors.record import KIND_ALIASES, KINDS, MOST_OUTSIDE, PROCESSES, LoopRecord
from detectors.records.archive import Series, base_step, hold, stored_on_change
from detectors.records.clock import seconds
from detectors.records.gaps import BRIDGED, JITTER, MOST_MISSING, whole
from detectors.records.historian import apply_quality, is_head, op_span, read_numbers, take_units
from detectors.records.long_table import read_series, unfold
from detectors.records.roles import SIGNALS, TIME_NAMES, find_roles, shown, words
from detectors.records.tables import Sheet, read_sheet, read_table

_RECORD_LABELS = ("stiction", "no_stiction", "unknown")
# what a loop without stiction may be said to have instead; more words may follow ("tuning problem")
_CAUSES = ("tuning", "disturbance", "load", "interaction", "sensor", "nonlinearity", "quantisation", "healthy", "other")
RECORD_FILES = (".csv", ".txt", ".parquet", ".xlsx")  # what is read of a folder


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    loop: str | None = None,
    Ts: float | None = None,
    **about: Any,
) -> LoopRecord:
    """Read one loop record from a file.

    Parameters
    ----------
    path : str or Path
        CSV, .parquet, .xlsx or ISDB .mat, wide (a column per signal) or long (time, tag, value).
    columns : dict of role to column name, optional
        Which column (long: tag) holds `t`, `sp`, `op`, `pv`, `mv`, where the names do not say so.
    loop : str, optional
        "sector.loopN" of a .mat file; of a table with several loops the first words of its columns ("FIC101").
    Ts : float, optional
        Sampling period (s), in place of the time column.
    **about
        Other fields of the record: process, kind, op_span, pv_span, tag, meta.

    Returns
    -------
    LoopRecord
        Holes of up to 3 samples are bridged by straight lines; longer ones split the record and the longest whole
        segment is returned; of an archive that stores changes only, values hold until the next. `notes` says all of it, and
        everything else that had to be assumed: lines left out, states such as "Bad", units, the order of day and month.

    Raises
    ------
    RecordError
        In one sentence: missing, empty or binary file, no PV or OP column, or several, text where a number should be (with
        its line), what can be read in two ways, time that does not rise, more than 20 % missing, fewer than 3 samples.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "FIC101.csv"
    >>> _ = file.write_text("t_s,OP,PV\\n0,50,1.0\\n2,51,\\n4,52,1.4\\n6,52,1.5\\n8,52,1.6\\n")
    >>> record = read_record(file, kind="flow")
    >>> record.Ts, record.pv.tolist(), record.notes
    (2.0, [1.0, 1.2, 1.4, 1.5, 1.6], ('gaps: 1 of 5 samples missing, bridged by straight lines',))
    """
    path = Path(path)
    if path.suffix.lower() == ".mat":
        from detectors.records.isdb import read_loop

        columns_of, found = read_loop(path, loop)
        sheet, loop = Sheet(columns_of), None
    else:
        sheet, found = read_sheet(path, lambda cells: is_head(cells, columns or {})), {}
    found.update({k: v for k, v in about.items() if v is not None})
    found.setdefault("tag", path.stem)
    Ts = Ts if Ts is not None else found.pop("Ts", None)
    try:
        return _record(sheet, columns or {}, loop, Ts, found, str(path))
    except RecordError as error:
        raise error if str(path) in str(error) else RecordError(f"{path}: {error}") from None


def read_folder(
    path: str | Path,
    names: Iterable[str] | None = None,
    each: Mapping[str, Mapping[str, Any]] | None = None,
    **about: Any,
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop record of a folder, or every loop of an ISDB .mat file."""
    path = Path(path)
    given = {k: v for k, v in about.items() if v is not None}
    if path.suffix.lower() == ".mat":
        from detectors.records.isdb import read_loops

        sources = {name: (path, name) for name in read_loops(path)}
    elif path.is_dir():
        sources = {f.stem: (f, None) for f in sorted(path.iterdir()) if f.suffix.lower() in RECORD_FILES}
    else:
        raise RecordError(f"folder {path} does not exist")
    wanted = sources if names is None else [n for n in sources if n in set(names)]
    records, refused = {}, {}
    for name in wanted:
        file, loop = sources[name]
        try:
            records[name] = read_record(file, loop=loop, **{**(each or {}).get(name, {}), **given})
        except RecordError as error:
            refused[name] = str(error)
    if not records:
        first = next(iter(refused.values()), "it holds no .csv, .parquet, .xlsx or .mat file")
        raise RecordError(f"{path}: no loop record found ({first})")
    return records, refused


def read_labels(path: str | Path) -> dict[str, dict[str, str]]:
    """Read a table of labels, one row per record."""
    raw = read_table(Path(path))
    rows = {str(k).strip().lower(): v for k, v in raw.items()}
    key = next((k for k in ("id", "record") if k in rows), None)
    if key is None or "label" not in rows:
        has = ", ".join(rows)
        raise RecordError(f"{path}: a table of labels needs the columns id (or record) and label; it has {has:.200}")
    table = {}
    for i, name in enumerate(rows[key]):
        row = {k: str(v[i]).strip() for k, v in rows.items()}
        kind = _hyphens(row.get("kind") or row.get("type", ""))
        process = _hyphens(row.get("process") or row.get("dynamics", ""))
        row["kind"] = kind if KIND_ALIASES.get(kind, kind) in KINDS else ""
        row["process"] = process if process in PROCESSES else ""
        row["loop"] = row.get("loop") or str(name)
        row["unit_group"] = row.get("unit_group") or row["loop"]
        row["label"] = _label(row["label"], f"{path}, line {i + 2}")
        table[str(name).strip()] = row
    return table


def _label(text: str, where: str) -> str:
    # a misspelt "stiction" would count as its opposite
    word = "_".join(re.findall(r"[a-z]+", text.lower()))
    if text in ("", "nan"):
        return ""
    if word not in _RECORD_LABELS and not word.startswith(_CAUSES):
        raise RecordError(f"{where}: label {text[:60]!r} is unknown, {nearest(word, (*_RECORD_LABELS, *_CAUSES))}")
    return word


def _record(sheet: Sheet, chosen: Mapping[str, str], loop: str | None, Ts: float | None, about: dict, where: str) -> LoopRecord:
    if Ts is not None and not 0 < Ts < np.inf:
        raise RecordError(f"{where}: Ts = {Ts} s; the sampling period must be a number above 0")
    parts = unfold(sheet, loop, chosen, where)
    if parts is None:
        t, signals = _wide(sheet, chosen, loop, Ts, about, where)
        given = Ts
    else:
        _required(list(parts), list(dict.fromkeys(str(v) for c in parts.values() for v in list(c.columns)[1:2])), where)
        t, signals, given = _long(parts, Ts, where)
        sheet.notes += [note for part in parts.values() for note in part.notes]
    if t.size < 3:
        raise RecordError(f"{where}: {t.size} samples; at least 3 are needed")
    series = {r: (t[np.isfinite(x)], x[np.isfinite(x)]) for r, x in signals.items() if np.isfinite(x).any()}
    if given is None and _on_change(t, series):
        t, signals, Ts, notes = hold(series, base_step(t), where)
        late = [r for r, x in signals.items() if not np.isfinite(x).all()]
        notes += [f"archive: {r.upper()} begins later than OP and PV and is left out" for r in late]
        signals = {r: x for r, x in signals.items() if r not in late}
    else:
        Ts = float(np.median(np.diff(t))) if given is None else float(given)
        t, signals, notes = whole(t, signals, Ts, where)
    record = LoopRecord(Ts=Ts, notes=(*sheet.notes, *notes), **signals, **about)
    return replace(record, notes=(*record.notes, *_outside(record, where)))


def _outside(record: LoopRecord, where: str) -> list[str]:
    """Refuse a span that is another signal's; say of how many samples a signal leaves its own."""
    said = []
    for name in ("op", "pv"):
        lo, hi = getattr(record, f"{name}_span") or (0.0, 0.0)
        told = f"{name.upper()} lies outside {name}_span {lo:g} to {hi:g} in"
        if (share := record.outside(name)) > MOST_OUTSIDE:
            x = getattr(record, name)
            needed = f"it is {x.min():.4g} to {x.max():.4g}; the values that mean 0 and 100 % are needed"
            raise RecordError(f"{where}: {told} {share:.0%} of the samples, {needed}")
        if share := record.outside(name, 0.0):
            said.append(f"span: {told} {share:.1%} of the samples")
    return said


def _wide(sheet: Sheet, chosen: Mapping[str, str], loop: str | None, Ts: float | None, about: dict, where: str):
    """Read a table with a column per signal: times and signals as they stand in it, NaN where unknown."""
    units = take_units(sheet, chosen)
    roles = find_roles(list(sheet.columns), chosen, where, loop)
    _required(list(roles), list(sheet.columns), where)
    sheet.notes += [
        f"columns: {role.upper()} is {name!r}"
        for role, name in roles.items()
        if role != "t" and role not in chosen and words(name)[-1:] != [role]
    ]
    read = read_numbers(sheet, [roles[s] for s in SIGNALS if s in roles], where)
    signals = {s: read[roles[s]] for s in SIGNALS if s in roles}
    apply_quality(sheet, roles, signals, where)
    span = op_span(units.get(roles["op"], ""), about.get("op_span"), where, sheet.notes)
    if span is not None:
        about["op_span"] = span
    n = signals["pv"].size
    if n < 3:
        raise RecordError(f"{where}: {n} samples; at least 3 are needed")
    if Ts is not None:
        return np.arange(n) * float(Ts), signals
    if "t" not in roles:
        names = ", ".join(TIME_NAMES[:6])
        raise RecordError(f"{where}: no time column ({names}) and no sampling period Ts given; either is needed")
    name = roles["t"]
    cells = _with_date(sheet, name)
    return seconds(cells, name, where, unit=units.get(name, ""), place=sheet.place, notes=sheet.notes), signals


def _with_date(sheet: Sheet, name: str):
    """Join a column of dates and one of clock times."""
    low = {str(n).strip().lower(): n for n in sheet.columns}
    cells = sheet.columns[name]
    if not {"date", "time"} <= set(low) or not isinstance(cells, list):
        return cells
    if name != low["date"] and any(mark in str(c) for c in cells[:1] for mark in "-/"):
        return cells  # it holds the date already
    dates, clocks = sheet.columns[low["date"]], sheet.columns[low["time"]]
    return [f"{str(d).split(' ')[0]} {c}" for d, c in zip(dates, clocks, strict=True)]


def _long(parts: Mapping[str, Sheet], Ts: float | None, where: str):
    """Put the tags of a long table side by side; returns also the sampling period, where it was needed to do so."""
    series = {role: read_series(part, role, where) for role, part in parts.items()}
    for role in ("op", "pv"):
        if series[role][0].size < 3:
            raise RecordError(f"{where}: {series[role][0].size} samples of {role.upper()}; at least 3 are needed")
    times = np.unique(np.concatenate([series["op"][0], series["pv"][0]]))
    step = base_step(times)
    full = step is not None and min(series[r][0].size for r in ("op", "pv")) * step > (1 - MOST_MISSING) * (
        times[-1] - times[0]
    )
    if Ts is None and (full or _on_change(times, series)):
        signals = {role: _at(times, *series[role]) for role in ("op", "pv")}
        signals |= {role: _held(times, *series[role]) for role in ("sp", "mv") if role in series and series[role][0].size}
        return times, signals, None
    uneven = [r for r in ("op", "pv") if not _regular(series[r][0]) and not stored_on_change(*series[r])]
    if Ts is None and uneven:
        raise RecordError(f"{where}: times of {' and '.join(uneven).upper()} are uneven; say which sampling period Ts to use")
    t, signals, step, notes = hold(series, Ts, where)
    parts["pv"].notes += notes or ["archive: OP and PV have times of their own; OP is the last value before each PV"]
    return t, signals, step


def _at(times: np.ndarray, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    out = np.full(times.size, np.nan)
    out[np.searchsorted(times, t)] = x
    return out


def _held(times: np.ndarray, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    at = np.searchsorted(t, times, side="right") - 1
    return np.where(at >= 0, x[np.maximum(at, 0)], np.nan)


def _regular(t: np.ndarray) -> bool:
    dt = np.diff(t)
    return bool(np.mean(np.abs(dt - np.median(dt)) <= JITTER * np.median(dt)) > 1 - MOST_MISSING)


def _on_change(t: np.ndarray, series: Mapping[str, Series]) -> bool:
    """Whether what is missing of OP and PV is missing because it had not changed."""
    step = base_step(t)
    if step is None or not {"op", "pv"} <= set(series):
        return False
    size = round((t[-1] - t[0]) / step) + 1
    sparse = []
    for role in ("op", "pv"):
        when = series[role][0]
        if when.size < (1 - MOST_MISSING) * size or np.diff(when).max(initial=0.0) > (BRIDGED + 1.5) * step:
            sparse.append(role)
    return bool(sparse) and all(stored_on_change(*series[role]) for role in sparse)


def _required(roles: list[str], names: list[str], where: str) -> None:
    for role in ("pv", "op"):
        if role not in roles:
            hint = "; MV may be the controller's output: then say so (columns op=MV)" if role == "op" and "mv" in roles else ""
            raise RecordError(f"{where}: no {role.upper()} column; columns are: {shown(names)}{hint}")


def _hyphens(word: str) -> str:
    return word.strip().lower().replace("_", "-").replace(" ", "-")

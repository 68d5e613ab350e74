"""Loaders: CSV, parquet, Excel and ISDB .mat files become LoopRecords; every bad file is one clear sentence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from detectors.errors import RecordError, nearest
from detectors.record import KIND_ALIASES, KINDS, PROCESSES, LoopRecord
from detectors.tables import Columns, numbers, read_table, seconds

SIGNALS = ("sp", "op", "pv", "mv")
TIME_NAMES = ("t_s", "t", "time", "timestamp", "datetime", "date")
BRIDGED = 3  # samples; a longer hole splits the record
MOST_MISSING = 0.20  # share of a record that may be missing
JITTER = 0.01  # deviation from Ts, as a share of it, above which time has a gap


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
        CSV (comma, semicolon or tab), .parquet, .xlsx or ISDB .mat.
    columns : dict of role to column name, optional
        Which column holds `t`, `sp`, `op`, `pv`, `mv`, where the names do not say so.
    loop : str, optional
        "sector.loopN", for a .mat file with several loops.
    Ts : float, optional
        Sampling period (s), in place of the time column.
    **about
        Other fields of the record: process, kind, op_span, pv_span, tag, meta.

    Returns
    -------
    LoopRecord
        Holes of up to 3 samples are bridged by straight lines; longer ones split the record and the longest whole
        segment is returned. Both are said in `notes`.

    Raises
    ------
    RecordError
        In one sentence: missing, empty or binary file, wrong encoding, no PV or OP column, text where a number should
        be (with its line), time that does not rise, more than 20 % missing, fewer than 3 samples.

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
        from detectors.isdb import read_loop

        raw, found = read_loop(path, loop)
    else:
        raw, found = read_table(path), {}
    found.update({k: v for k, v in about.items() if v is not None})
    found.setdefault("tag", path.stem)
    Ts = Ts if Ts is not None else found.pop("Ts", None)
    try:
        return _record(raw, columns or {}, Ts, found, str(path))
    except RecordError as error:
        raise error if str(path) in str(error) else RecordError(f"{path}: {error}") from None


def read_folder(
    path: str | Path,
    names: Iterable[str] | None = None,
    each: Mapping[str, Mapping[str, Any]] | None = None,
    **about: Any,
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop record of a folder, or every loop of an ISDB .mat file.

    Parameters
    ----------
    path : str or Path
        Folder or .mat file.
    names : iterable of str, optional
        File stems (or loops) to read; all when absent.
    each : dict of str to dict, optional
        What is known of single records (process, kind, ...), by name.
    **about
        As in `read_record`, for all; goes before `each`.

    Returns
    -------
    records : dict of str to LoopRecord
        By file stem, sorted.
    refused : dict of str to str
        The sentence for every file that is no record.

    Raises
    ------
    RecordError
        When the folder is missing or holds no record at all.
    """
    path = Path(path)
    given = {k: v for k, v in about.items() if v is not None}
    if path.suffix.lower() == ".mat":
        from detectors.isdb import read_loops

        sources = {name: (path, name) for name in read_loops(path)}
    elif path.is_dir():
        kinds = (".csv", ".txt", ".parquet", ".xlsx")
        sources = {f.stem: (f, None) for f in sorted(path.iterdir()) if f.suffix.lower() in kinds}
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
    """Read a table of labels, one row per record.

    Parameters
    ----------
    path : str or Path
        CSV with a column `id` or `record`, and any of label, kind (or type), process (or dynamics), unit_group, loop.

    Returns
    -------
    dict of str to dict of str to str
        By record name: label, kind, process, loop, unit_group and every other column as text. Underscores in kind and
        process read as hyphens; words that a record does not know become "".

    Raises
    ------
    RecordError
        When the file cannot be read or has no such column.
    """
    raw = read_table(Path(path))
    rows = {str(k).strip().lower(): v for k, v in raw.items()}
    key = next((k for k in ("id", "record") if k in rows), None)
    if key is None or "label" not in rows:
        has = ", ".join(rows)
        raise RecordError(f"{path}: a table of labels needs the columns id (or record) and label; it has {has}")
    table = {}
    for i, name in enumerate(rows[key]):
        row = {k: str(v[i]).strip() for k, v in rows.items()}
        kind = _hyphens(row.get("kind") or row.get("type", ""))
        process = _hyphens(row.get("process") or row.get("dynamics", ""))
        row["kind"] = kind if KIND_ALIASES.get(kind, kind) in KINDS else ""
        row["process"] = process if process in PROCESSES else ""
        row["loop"] = row.get("loop") or str(name)
        row["unit_group"] = row.get("unit_group") or row["loop"]
        row["label"] = row["label"].lower().replace("-", "_")
        table[str(name).strip()] = row
    return table


def _record(raw: Columns, columns: Mapping[str, str], Ts: float | None, about: dict, where: str) -> LoopRecord:
    roles = _roles(list(raw), columns, where)
    signals = {s: numbers(raw[roles[s]], roles[s], where) for s in SIGNALS if s in roles}
    n = signals["pv"].size
    if n < 3:
        raise RecordError(f"{where}: {n} samples; at least 3 are needed")
    if Ts is None:
        if "t" not in roles:
            raise RecordError(f"{where}: no time column ({', '.join(TIME_NAMES)}) and no sampling period Ts given")
        t = seconds(raw[roles["t"]], roles["t"], where)
        Ts = float(np.median(np.diff(t)))
    elif not 0 < Ts < np.inf:
        raise RecordError(f"{where}: Ts = {Ts} s; the sampling period must be a number above 0")
    else:
        t = np.arange(n) * float(Ts)
    t, signals, notes = _whole(t, signals, Ts, where)
    return LoopRecord(Ts=Ts, notes=notes, **signals, **about)


def _whole(t: np.ndarray, signals: dict[str, np.ndarray | None], Ts: float, where: str):
    """Put the samples on an even grid, bridge short holes, keep the longest segment without a long one."""
    dt = np.diff(t)
    if np.any(np.abs(dt - Ts) > JITTER * Ts):
        place = np.concatenate([[0], np.cumsum(np.maximum(np.rint(dt / Ts), 1).astype(int))])
    else:
        place = np.arange(t.size)
    size = int(place[-1]) + 1
    known = np.isfinite(signals["op"]) & np.isfinite(signals["pv"])
    missing = size - int(known.sum())
    if missing > MOST_MISSING * size:
        raise RecordError(f"{where}: {missing} of {size} samples are missing; at most {MOST_MISSING:.0%} may be")
    places = place[known]
    ends = np.flatnonzero(np.diff(places) > BRIDGED + 1)
    first, last = np.concatenate([[0], ends + 1]), np.concatenate([ends, [places.size - 1]])
    longest = int(np.argmax(places[last] - places[first]))
    lo, hi = int(places[first[longest]]), int(places[last[longest]])
    grid = np.arange(lo, hi + 1)
    out: dict[str, np.ndarray | None] = {}
    notes = []
    for name, x in signals.items():
        here = np.isfinite(x) & (place >= lo) & (place <= hi)
        holes = np.diff(np.concatenate([[lo - 1], place[here], [hi + 1]]))
        if name in ("sp", "mv") and (not here.any() or holes.max() > BRIDGED + 1):
            if here.any():
                notes.append(f"gaps: {name.upper()} has holes of more than {BRIDGED} samples and is left out")
            out[name] = None
        elif name == "sp":  # a set point holds its value until it is changed
            out[name] = x[here][np.maximum(np.searchsorted(place[here], grid, side="right") - 1, 0)]
        else:
            out[name] = np.interp(grid, place[here], x[here])
    bridged = grid.size - int(known[(place >= lo) & (place <= hi)].sum())
    uneven = int(np.sum(np.abs(dt - np.rint(dt / Ts) * Ts) > JITTER * Ts))
    if bridged:
        notes.insert(0, f"gaps: {bridged} of {grid.size} samples missing, bridged by straight lines")
    if grid.size < size:
        part = f"the longest part without a hole of more than {BRIDGED}"
        notes.insert(0, f"gaps: judged samples {lo} to {hi} of {size}, {part}")
    if uneven:
        notes.append(f"gaps: {uneven} of {dt.size} time steps differ from Ts = {Ts:g} s by more than {JITTER:.0%}")
    return grid * Ts, out, tuple(notes)


def _roles(names: list[str], chosen: Mapping[str, str], where: str) -> dict[str, str]:
    """Return which column plays which role; 'FIC101.PV' and 'PV (m3/h)' count as pv unless two columns do."""
    roles = {}
    for role, name in chosen.items():
        role = "t" if role in TIME_NAMES else role
        if role not in ("t", *SIGNALS):
            raise RecordError(f"{where}: column mapping for {role!r}; {nearest(role, ('t', *SIGNALS))}")
        if name not in names:
            raise RecordError(f"{where}: no column {name!r} for {role}, {nearest(name, names)}")
        roles[role] = name
    plain = {str(n).strip().lower(): n for n in reversed(names)}
    short: dict[str, list[str]] = {}
    for n in names:
        short.setdefault(re.split(r"[./:\\ ]", re.sub(r"\s*[\[(].*$", "", str(n).strip().lower()))[-1], []).append(n)
    for role in ("t", *SIGNALS):
        words = TIME_NAMES if role == "t" else (role,)
        exact = [plain[w] for w in words if w in plain]
        loose = [m for w in words for m in short.get(w, [])]
        if role not in roles and (exact or len(loose) == 1):
            roles[role] = (exact or loose)[0]
    for role in ("pv", "op"):
        if role not in roles:
            shown = ", ".join(map(str, names[:12])) + (", ..." if len(names) > 12 else "")
            raise RecordError(f"{where}: no {role.upper()} column; columns are: {shown}")
    return roles


def _hyphens(word: str) -> str:
    return word.strip().lower().replace("_", "-").replace(" ", "-")

"""Read CSV, parquet, Excel and MATLAB files as `LoopRecord`: table, columns, times, gaps, record;
a file that cannot be read gives one clear sentence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, RecordError, nearest, printable
from simbench.detectors.record import MOST_OUTSIDE, LoopRecord
from simbench.detectors.records import times
from simbench.detectors.records.columns import (
    LAYOUT,
    MANUAL,
    MODE,
    SIGNALS,
    Roles,
    choose_loop,
    find_loops,
    find_time,
    is_head,
    parse,
    read_modes,
    read_numbers,
    refuse_missing,
    split_by_tag,
    take_samples,
)
from simbench.detectors.records.files import Sheet, read_tables, table_of
from simbench.detectors.signal.holds import runs_of

Found = dict[str, LoopRecord | RecordError]  # each loop, or why it is no record

# what a row of a table of loops may state of a record, and where to find it or what it is called
_OF_RECORD = ("columns", "op_span", "pv_span", "kind", "process", "Ts", "resample")
_OF_ROW = ("tag", "file", "label", "loop", "unit_group")
# values that mean 0 and 100 % of travel: those of a current are taken, others are asked for
_SPANS = {
    **{"ma": (4.0, 20.0), "v": (1.0, 5.0), "volt": (1.0, 5.0), "bar": (0.2, 1.0)},
    **{"kpa": (20.0, 100.0), "psi": (3.0, 15.0), "psig": (3.0, 15.0), "counts": (0.0, 4095.0)},
}
_CURRENT = (3.5, 20.6)  # what an output of 4 to 20 mA may read


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    tag: str | None = None,
    Ts: float | None = None,
    loops: str | Path | None = None,
    automatic: bool = True,
    **about: Any,
) -> LoopRecord:
    """Read one loop record from a file.

    Parameters
    ----------
    path : str or Path
        CSV, .parquet, .xlsx or ISDB .mat: a row per time and a column per signal.
    columns : dict of role to column name, optional
        Which column holds `t`, `sp`, `op`, `pv`, `mv`, `mode`, where the names do not
        say so; `quality="none"` reads no quality, as `mv`, `sp` and `mode` "none" read none of
        these.
    tag : str, optional
        Of a file with several loops the one to read: "FIC101", "[default]Unit1/FIC101", of a .mat
        file "sector.loopN"; where no column names a loop, the name of the record.
    Ts : float, optional
        Sampling period (s), in place of the time column.
    loops : str or Path, optional
        A TOML file of [[loop]] tables that states what the caller does not: tag, file, columns,
        op_span, pv_span, kind, process, Ts, resample.
    automatic : bool
        Where the controller's mode is recorded, return the longest stretch in automatic; else all,
        `meta["manual"]` marks where OP was the operator's, and `meta["rows"]` holds the sample of
        each row.
    **about
        Other fields of the record: process, kind, op_span, pv_span, meta; and `resample`, by which
        samples at uneven times are put on an even grid of `Ts` or of their median step: "held",
        each value until the next, or "linear", straight lines between them.

    Returns
    -------
    LoopRecord
        Holes of up to 3 samples are bridged by straight lines; longer ones split the record and the
        longest whole segment is returned. `notes` lists all of it, and everything else that had to
        be assumed: lines left out, states such as "Bad", units, the order of day and month.

    Raises
    ------
    RecordError
        In one sentence that ends with the options that help: missing, empty or binary file, no PV
        or OP column, or several loops, text where a number should be (with its line), what can be
        read in two ways, time that does not rise, more than 20 % missing, fewer than 3 samples.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "FIC101.csv"
    >>> _ = file.write_text("t_s,OP,PV\\n0,50,1.0\\n2,51,\\n4,52,1.4\\n6,52,1.5\\n8,52,1.6\\n")
    >>> record = read_record(file, kind="flow")
    >>> record.Ts, record.pv.tolist(), record.notes
    (2.0, [1.0, 1.2, 1.4, 1.5, 1.6], ('gaps: 1 of 5 samples of PV missing, bridged',))
    """
    given = {"columns": columns, "Ts": Ts, "automatic": automatic, **about}
    found = _read_loops_of(Path(path), tag, loops, given)
    read = {}
    for name, one in found.items():
        if isinstance(one, LoopRecord):
            read[name] = one
    return _only_loop(read or found if loops else found, str(path))


def read_columns(
    table: Any, *, columns: Mapping[str, str] | None = None, tag: str | None = None, **about: Any
) -> LoopRecord:
    """Read one loop record from a data frame, or from a mapping of names to arrays, as
    `read_record` reads a file.
    """
    given = {"columns": columns, **about}
    return _only_loop(_read_loops({"": table_of(table, "table")}, tag, given, ""), "table")


def read_records(
    path: str | Path, *, tag: str | None = None, loops: str | Path | None = None, **given: Any
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop of a file: records by tag, and of what is refused the sentence."""
    found = _read_loops_of(Path(path), tag, loops, given)
    records = {}
    for name, one in found.items():
        if isinstance(one, LoopRecord):
            records[name] = one
    if not records and loops is None:
        _only_loop(dict(list(found.items())[:1]), str(path))
    return records, {name: str(one) for name, one in found.items() if name not in records}


def _read_loops_of(
    path: Path, tag: str | None, loops: str | Path | None, given: Mapping[str, Any]
) -> Found:
    """Return what a file holds by tag, with what a table of loops states of each."""
    found: Found = {}
    for row in [] if loops is None else read_loop_table(loops):
        if row.get("file", path.name) != path.name or tag not in (None, row["tag"]):
            continue
        about = {}
        for key in _OF_RECORD:
            if key in row:
                about[key] = row[key]
        about |= {key: value for key, value in given.items() if value is not None}
        if "columns" in row:
            own = None
        else:
            own = row["tag"]
        try:
            # where nothing names the file, its columns must name the tag
            loop = _only_loop(_read_file(path, own, about, tag is None and "file" not in row), "")
            found[row["tag"]] = replace(loop, tag=row["tag"])
        except RecordError as error:
            found[row["tag"]] = error
    return found or _read_file(path, tag, given)


def _only_loop(found: Found, where: str) -> LoopRecord:
    """Return the only loop that was found, or raise why there is none, or which there are."""
    name, one = next(iter(found.items()))
    if len(found) > 1:
        several = f"{where}: {len(found)} loops: {', '.join(found)[:200]}"
        raise RecordError(f"{several}; the tag of one is needed", f"--tag {quote(name)}")
    if isinstance(one, RecordError):
        raise one
    return one


def read_loop_table(path: str | Path) -> list[dict[str, Any]]:
    """Return what a TOML file states of each loop, one dict each, checked."""
    import tomllib

    # [[loop]] tables and nothing else
    needed = "[[loop]] tables, one a tag, are needed"
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordError(f"table of loops {path} is no TOML: {error}; {needed}") from None
    rows = table.get("loop")
    if not isinstance(rows, list) or not rows or set(table) != {"loop"}:
        has = ", ".join(table) or "nothing"
        raise RecordError(f"table of loops {path}: it has {has}; {needed}")

    # with the keys that are known
    for k, row in enumerate(rows, 1):
        where = f"table of loops {path}, loop {k}"
        odd = next((key for key in row if key not in (_OF_RECORD + _OF_ROW)), None)
        if odd is not None:
            known = nearest(odd, _OF_RECORD + _OF_ROW)
            raise RecordError(f"{where}: unknown key {odd!r}, {known}")
        names = row.get("columns", {})
        if isinstance(names, dict):
            texts = [row.get("tag"), *names.values()]
        else:
            texts = [names]
        if not set(map(type, texts)) <= {str}:
            raise RecordError(f"{where}: a tag is needed, and columns as a table of names")
    return rows


def _read_file(
    path: Path, tag: str | None, given: Mapping[str, Any], inside: bool = False
) -> Found:
    """Return what a file holds by tag."""
    chosen = given.get("columns") or {}
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.matlab import read_loops

        tables = read_loops(path)
    else:
        tables = read_tables(path, lambda cells: is_head(cells, chosen))
    return _read_loops(tables, tag, given, path.stem, inside)


def _read_loops(
    tables: Mapping[str, Sheet],
    tag: str | None,
    given: Mapping[str, Any],
    stem: str,
    inside: bool = False,
) -> Found:
    """Return what tables hold by tag; a tag names the only loop where no column names one, unless
    it must stand `inside`, and `stem` one that nothing else names.
    """
    # the loops that the columns name
    about = {}
    for key, value in given.items():
        if value is not None:
            about[key] = value
    chosen = about.pop("columns", {})
    loops: dict[str, tuple[Sheet, Roles]] = {}
    for sheet, table in tables.items():
        take_samples(table, chosen)
        for part, rows in split_by_tag(table).items():
            for name, roles in find_loops(rows, chosen).items():
                label = name or part or sheet
                own = replace(rows, notes=list(rows.notes))
                loops[label if label not in loops else f"{sheet} {label}"] = own, roles

    # those that are asked for
    where = next(iter(tables.values())).where
    if tag is None:
        asked = list(loops)
    else:
        asked = choose_loop(tag, loops)
    if not asked and list(loops) == [""] and not inside:
        loops[""][0].notes.append(f"tag: no column names a loop; the only one is read as {tag}")
        asked = [""]
        stem = str(tag)
    if not asked:
        known = ", ".join(loops)[:200]
        lacks = f"{where}: no column of loop {tag!r}; the tag of a loop is needed: {known}"
        (like,) = get_close_matches(str(tag), loops, 1, 0.0)
        raise RecordError(lacks, f"--tag {quote(like)}" if like else "")

    # each as a record, or why it is none
    found: Found = {}
    for label in asked:
        table, roles = loops[label]
        alone = len(loops) == 1 and tag is None and "" in tables
        name = printable(stem if alone or not label else label)
        try:
            stated = {"tag": name, **table.about, **about}
            found[name] = _make_record(table, roles, chosen, stated)
        except RecordError as error:
            if where in str(error):
                said = error.sentence
            else:
                said = f"{where}: {error.sentence}"
            found[name] = RecordError(said, error.cure)
    return found


def _make_record(
    table: Sheet, roles: Roles, chosen: Mapping[str, str], about: dict[str, Any]
) -> LoopRecord:
    """Return the record of one loop of a table, with the notes on all that was done to it."""
    # columns as numbers and modes
    where = table.where
    Ts = about.pop("Ts", None)
    how = about.pop("resample", None)
    automatic = about.pop("automatic", True)
    if how not in (None, times.HELD_VALUES, times.STRAIGHT_LINES):
        raise ParameterError(
            f"resample {how!r}: {nearest(str(how), (times.HELD_VALUES, times.STRAIGHT_LINES))}"
        )
    if Ts is not None and not (isinstance(Ts, (int, float)) and 0 < Ts < np.inf):
        raise RecordError(f"{where}: Ts = {Ts} s; the sampling period must be a number above 0")
    refuse_missing(table, roles)
    for role, name in roles.items():
        if role not in (MODE, *chosen) and parse(name).word != role:
            table.notes.append(f"columns: {role.upper()} is {name!r}")
    names = {}
    for role in SIGNALS:
        if role in roles:
            names[role] = roles[role]
    columns = read_numbers(table, names.values())
    signals = {role: columns[name] for role, name in names.items()}
    if MODE in roles:
        modes = read_modes(table, roles[MODE])
    else:
        modes = None
    known = np.isfinite(signals["op"]) & np.isfinite(signals["pv"])
    if known.size < times.SHORTEST:
        raise RecordError(f"{where}: {known.size} samples; at least {times.SHORTEST} are needed")
    if not known.any():
        raise RecordError(f"{where}: no row has both OP and PV; {LAYOUT} groupby(TIME).first()")

    # their times
    rows = np.arange(signals["pv"].size)
    if Ts is not None and how is None:
        t = rows * float(Ts)
    else:
        name = find_time(table, chosen, roles)
        t = times.read_times(table, name)
        rows = times.order_rows(t, signals, table, name, how is not None)
        t = t[rows]
        signals = {role: x[rows] for role, x in signals.items()}
        if modes is None:
            modes = None
        else:
            modes = modes[rows]
    if how is not None:
        recorded = t
        t, signals, Ts = times.resample(t, signals, Ts, how, table)
        last = np.searchsorted(recorded, t, side="right") - 1
        if modes is None:
            modes = None
        else:
            modes = modes[last]

    # on an even grid, the longest stretch in automatic alone unless all is asked for
    meta: dict[str, Any] = {}
    recorded = t
    if modes is not None and automatic:
        kept = _find_automatic(modes, table.notes)
        meta["automatic"] = float(np.mean(modes != MANUAL))
        t = t[kept]
        signals = {role: x[kept] for role, x in signals.items()}
    if Ts is None:
        step = float(np.median(np.diff(t)))
    else:
        step = float(Ts)
    begin, even = times.fill_gaps(t, signals, step, table)
    begin += float(t[0])
    if t[0] > times.CALENDAR:  # events are shared by records of the same time only
        meta["start"] = begin
    if not automatic:
        meta["rows"] = np.rint((recorded - begin) / step).astype(int)
        if modes is not None and (modes == MANUAL).any():
            middles = begin + (np.arange(even["pv"].size) + 0.5) * step
            meta["manual"] = modes[np.searchsorted(recorded, middles) - 1] == MANUAL

    # as a record
    about["meta"] = {**meta, **about.get("meta", {})}
    _take_span(table, roles, about)
    record = LoopRecord(Ts=step, **even, **about)
    return replace(record, notes=tuple(table.notes) + tuple(_check_spans(record, where)))


def _find_automatic(modes: np.ndarray, notes: list[str]) -> slice:
    """Return the longest stretch in automatic or cascade, and say what share of the record either
    is.
    """
    # the share of each mode
    said = ", ".join(
        f"{m} {np.mean(modes == m):.0%}" for m in ("AUTO", "CAS", MANUAL) if m in modes
    )

    # the longest run, all where none is long enough to judge
    runs = runs_of(modes != MANUAL)
    a, b = max(runs.tolist(), key=lambda run: run[1] - run[0], default=(0, 0))
    if b - a < times.SHORTEST:
        notes.append(
            f"mode: {said}: the controller is never in automatic, which says nothing about cycles"
        )
        return slice(None)
    if b - a < modes.size:
        part = f"judged samples {a} to {b - 1} of {modes.size} ({(b - a) / modes.size:.0%})"
        said = f"{said}; {part}, the longest stretch in automatic"
    notes.append(f"mode: {said}")
    return slice(a, b)


def _take_span(table: Sheet, roles: Roles, about: dict[str, Any]) -> None:
    """Take the span that the unit of OP fixes, or ask for it."""
    unit = table.units.get(roles["op"]) or parse(roles["op"]).unit
    if about.get("op_span") is None and unit in _SPANS:
        lo, hi = _SPANS[unit]
        if unit != "ma":
            asked = f"{table.where}: OP is in {unit!r}; which values mean 0 and 100 % is needed"
            raise RecordError(f"{asked} (op_span)", f"--op-span {lo:g} {hi:g}")
        about["op_span"] = lo, hi
        table.notes.append("unit: OP is in mA, 4 to 20 mA taken as 0 to 100 %")


def _check_spans(record: LoopRecord, where: str) -> list[str]:
    """Refuse a span that is another signal's; return notes on samples outside one, and on an OP of
    unknown unit.
    """
    # OP that may be no %; a share of 1 is asked for, as % is 100 times as large
    notes = []
    lo = float(record.op.min())
    hi = float(record.op.max())
    runs = f"OP runs from {lo:.4g} to {hi:.4g}"
    if record.op_span is None:
        if record.op_share:
            asked = f"{where}: {runs}, a share of 1 or %; which values mean 0 and 100 % is needed"
            raise RecordError(asked, "--op-span 0 1")
        if record.op_percent is None:
            unknown = (
                "which values mean 0 and 100 % of travel is not known (--op-span LO HI states it)"
            )
            notes.append(f"unit: {runs}, which is no %: S and J are in OP units; {unknown}")
        elif _CURRENT[0] <= lo < hi <= _CURRENT[1]:
            other = "is in mA, sizes are 6.25 times as large: add --op-span 4 20"
            notes.append(f"unit: {runs}, taken as %; if it {other}")

    # spans that are given
    for name in ("op", "pv"):
        lo, hi = getattr(record, f"{name}_span") or (0.0, 0.0)
        outside = f"{name.upper()} lies outside {name}_span {lo:g} to {hi:g} in"
        if (share := record.outside(name)) > MOST_OUTSIDE:
            x = getattr(record, name)
            needed = (
                f"it is {x.min():.4g} to {x.max():.4g}; the values that mean 0 and 100 % are needed"
            )
            raise RecordError(f"{where}: {outside} {share:.0%} of the samples, {needed}")
        if share := record.outside(name, 0.0):
            notes.append(f"span: {outside} {share:.1%} of the samples")
    return notes

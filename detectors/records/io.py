"""Load CSV, parquet, Excel and ISDB .mat files as `LoopRecord`; a file that cannot be read gives
one clear sentence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from simbench.detectors.errors import RecordError, printable
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.loop_table import read_loop_table
from simbench.detectors.records.one_loop import make_record
from simbench.detectors.records.opened import OpenedTable, open_sheet, open_tables, with_ranges
from simbench.detectors.records.roles import NONE, find_loops, is_loop, names_loops, several_loops
from simbench.detectors.records.tables import Sheet, columns_of


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    tag: str | None = None,
    loop: str | None = None,
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
    loop : str, optional
        The same as `tag`.
    Ts : float, optional
        Sampling period (s), in place of the time column.
    loops : str or Path, optional
        A table of loops (TOML) that states what the caller does not, see
        `simbench.detectors.records.loop_table`.
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
    (2.0, [1.0, 1.2, 1.4, 1.5, 1.6], ('gaps: 1 of 5 samples missing, bridged by straight lines',))
    """
    path = Path(path)
    wanted = tag if tag is not None else loop
    given = {"columns": columns, "Ts": Ts, "automatic": automatic, **about}
    for row in read_loop_table(loops) if loops is not None else []:
        if (wanted is None and row.get("file", path.name) == path.name) or row["tag"] == wanted:
            return _of_row(path, row, given, named=wanted is not None)
    return _only_loop(_of_file(path, wanted, single=True, **_merge_stated({}, given)))


def read_columns(
    table: Any,
    *,
    columns: Mapping[str, str] | None = None,
    tag: str | None = None,
    **about: Any,
) -> LoopRecord:
    """Read one loop record from a data frame, or from a mapping of names to arrays, as
    `read_record` reads a file.
    """
    cells = columns_of(table)
    where = "table"
    chosen = dict(columns or {})
    rows = len(next(iter(cells.values()), ()))
    sheet = Sheet(cells, [*range(rows)], unit="row")
    opened = {"": open_sheet(sheet, chosen, where)}
    given = {k: v for k, v in about.items() if v is not None}
    return _only_loop(_of_tables(opened, where, tag, chosen, "", single=True, **given))


def read_records(
    path: str | Path, *, tag: str | None = None, loops: str | Path | None = None, **given: Any
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop of a file: records by tag, and of what is refused the sentence."""
    path = Path(path)
    if loops is None:
        records, refused = _of_file(path, tag, **given)
        if not records:
            raise next(iter(refused.values()))
        return records, {name: str(error) for name, error in refused.items()}
    records = {}
    refusals = {}
    for row in read_loop_table(loops):
        if row.get("file", path.name) != path.name or (tag is not None and row["tag"] != tag):
            continue
        try:
            records[row["tag"]] = _of_row(path, row, given)
        except RecordError as error:
            refusals[row["tag"]] = str(error)
    return records, refusals


def _of_row(
    path: Path, row: Mapping[str, Any], given: Mapping[str, Any], named: bool = False
) -> LoopRecord:
    """Return the loop of a table's row; where neither row nor caller (`named`) names the file, its
    columns must name the tag.
    """
    tag = None if "columns" in row else row["tag"]
    loops = _of_file(
        path,
        tag,
        single=True,
        in_columns=not named and "file" not in row,
        **_merge_stated(row, given),
    )
    return replace(_only_loop(loops), tag=row["tag"])


def _only_loop(loops: tuple[dict[str, LoopRecord], dict[str, RecordError]]) -> LoopRecord:
    records, refused = loops
    if refused:
        raise next(iter(refused.values()))
    return next(iter(records.values()))


def _merge_stated(row: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a table of loops states about one, overridden by the caller."""
    both = {**row, **{k: v for k, v in given.items() if v is not None}}
    return {
        k: v for k, v in both.items() if k not in ("tag", "file", "label", "loop", "unit_group")
    }


def _of_file(
    path: Path,
    tag: str | None,
    *,
    columns: Mapping[str, str] | None = None,
    single: bool = False,
    in_columns: bool = False,
    **given: Any,
) -> tuple[dict[str, LoopRecord], dict[str, RecordError]]:
    """Return the records of a file by tag, and what was refused; of `single` only one is asked for.

    A tag names the only loop where no column names one, unless it must stand `in_columns`.
    """
    given = {k: v for k, v in given.items() if v is not None}
    chosen = dict(columns or {})
    where = str(path)
    if in_columns:
        given["in_columns"] = True
    tables = open_tables(path, chosen, tag)
    return _of_tables(tables, where, tag, chosen, path.stem, single, **given)


def _of_tables(
    tables: Mapping[str, OpenedTable],
    where: str,
    tag: str | None,
    chosen: Mapping[str, str],
    stem: str,
    single: bool = False,
    **given: Any,
) -> tuple[dict[str, LoopRecord], dict[str, RecordError]]:
    """Return the records of tables by tag, and what was refused; `stem` names a loop that nothing
    else does.
    """
    in_columns = given.pop("in_columns", False)
    loops: dict[str, tuple[OpenedTable, dict[str, str]]] = {}
    for sheet, table in tables.items():
        names = list(table.sheet.columns)
        only = (bool(sheet) or (tag is not None and not in_columns)) and not names_loops(names)
        if only and not (sheet or chosen or table.about):
            table.sheet.notes.append(f"tag: no column names a loop; the only one is read as {tag}")
        try:
            named = find_loops(names, chosen, where, None if only or len(tables) > 1 else tag)
        except RecordError as error:
            raise with_ranges(error, table) from None
        for name, roles in named.items():
            label = name or sheet or tag or ""
            if len(named) == 1 and not sheet and tag is None:
                label = printable(table.about.get("tag", stem))
            loops[label if label not in loops else f"{sheet} {label}"] = table, roles
    mine = {n: f for n, f in loops.items() if len(tables) == 1 or tag is None or is_loop(n, tag)}
    if not mine or (single and len(mine) > 1):
        raise several_loops({name: roles for name, (_, roles) in loops.items()}, where)
    records = {}
    refused = {}
    left_out = {role for role, name in chosen.items() if name.lower() == NONE}
    for label, (table, named) in mine.items():
        roles = {role: name for role, name in named.items() if role not in left_out}
        about = {"tag": printable(label or stem), **table.about, **given}
        try:
            records[label] = make_record(table.with_separate_notes(), roles, chosen, about)
        except RecordError as error:
            refused[label] = (
                error
                if where in str(error)
                else RecordError(f"{where}: {error.sentence}", error.cure)
            )
    return records, refused

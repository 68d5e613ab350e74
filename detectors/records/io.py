"""Load CSV, parquet, Excel and ISDB .mat files as `LoopRecord`; a file that cannot be read gives
one clear sentence.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, RecordError, nearest, printable
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import (
    KIND_ALIASES,
    KINDS,
    MOST_OUTSIDE,
    PROCESSES,
    LoopRecord,
    hyphenated,
)
from simbench.detectors.records.archive import (
    HELD_VALUES,
    STRAIGHT_LINES,
    Series,
    base_step,
    hold,
    last_known,
    resample,
    stored_on_change,
)
from simbench.detectors.records.clock import CALENDAR, seconds
from simbench.detectors.records.dialects import entries, words
from simbench.detectors.records.gaps import BRIDGED, JITTER, MOST_MISSING, SHORTEST, fill_gaps
from simbench.detectors.records.historian import (
    apply_quality,
    is_head,
    op_span,
    open_span,
    read_numbers,
    take_rows,
    take_units,
)
from simbench.detectors.records.long_table import by_loop, is_stamped, read_series, unfold
from simbench.detectors.records.loop_table import read_loop_table
from simbench.detectors.records.mode import AUTO, CAS, MAN, mode
from simbench.detectors.records.one_signal import join, signal_files
from simbench.detectors.records.roles import (
    ASKED,
    MODE,
    NONE,
    QUALITY_OF,
    SIGNALS,
    find_loops,
    find_time,
    is_loop,
    names_loops,
    no_column,
    parse,
    plain,
    several_loops,
    shown,
    unit,
)
from simbench.detectors.records.tables import (
    BLANK,
    Sheet,
    columns_of,
    example_of_columns,
    range_of,
    read_sheets,
    read_table,
    rises,
)
from simbench.detectors.signal.holds import runs_of

_RECORD_LABELS = ("stiction", "no_stiction", "unknown")
# what a loop without stiction may have instead; more words may follow ("tuning problem")
_CAUSES = entries("""
    tuning, disturbance, load, interaction, sensor, nonlinearity, quantisation, healthy, other
""")
_MILLISECONDS = entries("millitm, millisecond, milliseconds, msec, ms")
# first letter of a controller's tag, as in FIC101, LC-4, 12PIC10201 or TICA7: what it measures
_KIND_OF = {
    "F": "flow",
    "L": "level",
    "P": "pressure",
    "T": "temperature",
    "A": "analyser",
}
_LETTERS = re.compile(r"(?<![A-Za-z])([FLPTA])I?C[A-Z]?[ _-]?\d", re.ASCII)
# sampling periods (s) at which nobody records a loop for its control, by what it controls: a
# historian's minute, doubled, for fast loops, a quarter of an hour for any
_SLOWEST = {"flow": 120.0, "pressure": 120.0}
_SLOWEST_OF_ANY = 900.0
RECORD_FILES = (".csv", ".txt", ".parquet", ".xlsx")  # what is read of a folder


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
        CSV, .parquet, .xlsx or ISDB .mat: a column per signal, a row per time and tag, or a column
        of times per signal.
    columns : dict of role to column name, optional
        Which column (long: tag) holds `t`, `sp`, `op`, `pv`, `mv`, `mode`, where the names do not
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
        longest whole segment is returned; of an archive that stores changes only, values hold until
        the next. `notes` lists all of it, and everything else that had to be assumed: lines left
        out, states such as "Bad", units, the order of day and month.

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
    take_rows(sheet, chosen)
    units = take_units(sheet, chosen)
    _join_dates(sheet)
    opened = {"": _Opened(sheet, units, unfold(sheet, "none"), where)}
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


def read_folder(
    path: str | Path,
    names: Iterable[str] | None = None,
    each: Mapping[str, Mapping[str, Any]] | None = None,
    loops: str | Path | None = None,
    tag: str | None = None,
    **about: Any,
) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Read every loop of a folder, of a file with several, or of an ISDB .mat file."""
    path = Path(path)
    given = {k: v for k, v in about.items() if v is not None}
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.isdb import read_loops

        sources = {name: (path, name) for name in read_loops(path)}
    elif path.is_dir():
        # a tag given for many files picks a loop that their columns name, and names none
        files = [f for f in sorted(path.iterdir()) if f.suffix.lower() in RECORD_FILES]
        # files of one signal each are read with that of their loop's PV
        joined = {loop.files[0]: loop for loop in signal_files(files) if join(loop.files[0])}
        read_with = {f for loop in joined.values() for f in loop.files[1:]}
        files = [f for f in files if f not in read_with]
        titles = [joined[f].tag if f in joined else f.stem for f in files]
        sources = {name: (f, None) for name, f in zip(_names(files, titles), files, strict=True)}
    elif path.is_file():
        sources = {printable(path.stem): (path, tag)}
    else:
        raise RecordError(f"folder {path} does not exist")
    wanted = None if names is None else set(names)
    records: dict[str, LoopRecord] = {}
    refused: dict[str, str] = {}
    for name, (file, file_tag) in sources.items():
        asked = (
            wanted is None
            or loops is not None
            or any(w == name or w.startswith(f"{name} ") for w in wanted)
        )
        if not asked and len(sources) > 1:
            continue
        try:
            loaded, not_read = read_records(
                file, tag=file_tag, loops=loops, **{**(each or {}).get(name, {}), **given}
            )
        except ParameterError:  # an option that is wrong of every file
            raise
        except Exception as error:
            loaded = {}
            not_read = {printable(file.stem): printable(sentence_of(error))}
        several = len(loaded) + len(not_read) > 1
        for into, what in ((records, loaded), (refused, not_read)):
            for label, value in what.items():
                key = (
                    name
                    if not several and loops is None
                    else label
                    if path.is_file() or loops
                    else f"{name} {label}"
                )
                into[key if key not in into else f"{name} {label}"] = value  # pyright: ignore[reportArgumentType]
    if wanted is not None:
        records = {n: r for n, r in records.items() if n in wanted}
    if tag is not None and path.is_dir():
        records = {n: r for n, r in records.items() if is_loop(r.tag, tag)}
        refused = refused if records else {"": f"no column of loop {tag!r} in any file"}
    if not records:
        first = next(iter(refused.values()), "it holds no .csv, .parquet, .xlsx or .mat file")
        raise RecordError(f"{path}: no loop record found ({first})")
    return records, refused


def _names(files: Sequence[Path], titles: Sequence[str]) -> list[str]:
    """Return a name for each file: its title where no other has it, else with its ending, and
    numbered where two look alike even with it.
    """
    alike = Counter(map(printable, titles))
    names: list[str] = []
    for f, title in zip(files, titles, strict=True):
        name = printable(title if alike[printable(title)] == 1 else f.name)
        names.append(name if name not in names else f"{name} ({len(names)})")
    return names


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
    tables = _open_tables(path, chosen, tag)
    return _of_tables(tables, where, tag, chosen, path.stem, single, **given)


def _of_tables(
    tables: Mapping[str, _Opened],
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
    loops: dict[str, tuple[_Opened, dict[str, str]]] = {}
    for sheet, table in tables.items():
        names = list(table.parts or table.sheet.columns)
        only = (bool(sheet) or (tag is not None and not in_columns)) and not names_loops(names)
        if only and not (sheet or chosen or table.about):
            table.sheet.notes.append(f"tag: no column names a loop; the only one is read as {tag}")
        try:
            named = find_loops(names, chosen, where, None if only or len(tables) > 1 else tag)
        except RecordError as error:
            raise _with_ranges(error, table) from None
        for name, roles in named.items():
            label = name or sheet or tag or ""
            if len(named) == 1 and not sheet and tag is None:
                label = printable(table.loop or stem)
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
            records[label] = _record(table.with_separate_notes(), roles, chosen, about)
        except RecordError as error:
            refused[label] = (
                error
                if where in str(error)
                else RecordError(f"{where}: {error.sentence}", error.cure)
            )
    return records, refused


def read_labels(path: str | Path) -> dict[str, dict[str, str]]:
    """Read a table of labels, one row per record."""
    raw = read_table(Path(path))
    rows = {str(k).strip().lower(): v for k, v in raw.items()}
    key = next((k for k in ("id", "record") if k in rows), None)
    if key is None or "label" not in rows:
        has = ", ".join(rows)
        raise RecordError(
            f"{path}: a table of labels needs the columns id (or record) and label; it has"
            f" {has:.200}"
        )
    table = {}
    for i, name in enumerate(rows[key]):
        row = {k: str(v[i]).strip() for k, v in rows.items()}
        kind = hyphenated(row.get("kind") or row.get("type", ""))
        process = hyphenated(row.get("process") or row.get("dynamics", ""))
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
        raise RecordError(
            f"{where}: label {text[:60]!r} is unknown, {nearest(word, (*_RECORD_LABELS, *_CAUSES))}"
        )
    return word


@dataclass
class _Opened:
    """A file's table with the units of its columns and, where signals have separate times, a
    part per tag; `loop` is the tag of one whose signals have a file each, `about` what the file
    states.
    """

    sheet: Sheet
    units: dict[str, str]
    parts: dict[str, Sheet] | None
    where: str
    loop: str = ""
    about: dict[str, Any] = field(default_factory=dict)

    def with_separate_notes(self) -> _Opened:
        """Return the same with separate notes, for one of several loops."""
        parts = self.parts and {name: replace(p, notes=[]) for name, p in self.parts.items()}
        return replace(self, sheet=replace(self.sheet, notes=[*self.sheet.notes]), parts=parts)


def _open_tables(path: Path, chosen: Mapping[str, str], tag: str | None) -> dict[str, _Opened]:
    """Return a file's table, of a workbook with several those of its sheets by name, or the one
    that a tag names.
    """
    where = str(path)
    if path.suffix.lower() == ".mat":
        from simbench.detectors.records.isdb import read_loop

        cells, about = read_loop(path, tag)
        return {"": _Opened(Sheet(cells), {}, None, where, about["tag"], about)}
    if not chosen and (joined := join(path)) is not None:
        sheet = Sheet({}, notes=[*joined.notes])
        return {"": _Opened(sheet, joined.units, joined.parts, where, joined.tag)}
    given = [name for name in chosen.values() if name.lower() != NONE]
    counted = bool(given) and all(name.isdigit() for name in given)
    sheets = read_sheets(path, lambda cells: is_head(cells, chosen), counted)
    if len(sheets) > 1 and tag is not None:
        sheets = {n: s for n, s in sheets.items() if plain(n) == plain(tag)} or sheets
    several = len(sheets) > 1
    out = {}
    quality = chosen.get(QUALITY_OF, "none")
    for name, sheet in sheets.items():
        if quality.lower() != "none" and quality not in sheet.columns:
            known = nearest(quality, sheet.columns)
            raise RecordError(f"{where}: no column {quality!r} for quality, {known}")
        take_rows(sheet, chosen)
        units = take_units(sheet, chosen)
        _join_dates(sheet)
        if loops := {} if several else by_loop(sheet):
            return {loop: _Opened(part, units, None, where) for loop, part in loops.items()}
        out[name if several else ""] = _Opened(sheet, units, unfold(sheet, quality), where)
    return out


def _with_ranges(error: RecordError, table: _Opened) -> RecordError:
    """Return a refusal that asks which column is what with the columns and their ranges; any other
    as it is.
    """
    if f"={ASKED}" not in error.cure:
        return error
    cells = table.sheet.columns
    if table.parts:
        # of a part: its times, its values, and a quality
        cells = {name: list(part.columns.values())[1] for name, part in table.parts.items()}
    ranges = [f"{n[:60]} ({range_of(c)})" for n, c in cells.items() if not n.startswith(BLANK)]
    return RecordError(f"{error.sentence}; columns are: {shown(ranges, 90)}", error.cure)


def _record(
    table: _Opened, roles: dict[str, str], chosen: Mapping[str, str], about: dict[str, Any]
) -> LoopRecord:
    """Return the record of one loop of a table, with the notes on all that was done to it."""
    sheet = table.sheet
    where = table.where
    automatic = about.pop("automatic", True)
    Ts = about.pop("Ts", None)
    how = about.pop("resample", None)
    if how not in (None, HELD_VALUES, STRAIGHT_LINES):
        raise ParameterError(
            f"resample {how!r}: {nearest(str(how), (HELD_VALUES, STRAIGHT_LINES))}"
        )
    if Ts is not None and not 0 < Ts < np.inf:
        raise RecordError(f"{where}: Ts = {Ts} s; the sampling period must be a number above 0")
    for role in ("pv", "op"):
        if role not in roles:
            names = [n for n in table.parts or sheet.columns if not n.startswith(BLANK)]
            numbered = {n: sheet.columns[n] for n in names if n.isdigit() and n in sheet.columns}
            if numbered:
                sentence = f"{where}: {len(numbered)} columns have no names; which of them, counted"
                raise RecordError(
                    f"{sentence} from 1, is which is needed", _option_naming(numbered, names)
                )
            raise _with_ranges(no_column(role, roles, names, where), table)
    other = [(r, n) for r, n in roles.items() if r not in (MODE, *chosen)]
    sheet.notes += [f"columns: {r.upper()} is {n!r}" for r, n in other if parse(n).word != r]
    read = _read_wide if table.parts is None else _read_long
    t, signals, modes, given = read(table, roles, chosen, Ts, how)
    if t.size < SHORTEST:
        raise RecordError(f"{where}: {t.size} samples; at least {SHORTEST} are needed")
    named = table.units.get(roles["op"]) or unit(roles["op"])
    span = op_span(named, about.get("op_span"), signals["op"], where, sheet.notes)
    about |= {} if span is None else {"op_span": span}
    held = None if modes is None else _mode_held(modes, roles[MODE], sheet.notes)
    meta: dict[str, Any] = {}
    began = float(t[0])
    recorded = t
    if held is not None and automatic:
        t, signals, meta["automatic"] = _automatic(t, signals, held, sheet.notes)
        began = float(t[0])
    series = {r: _known_samples(t, x) for r, x in signals.items() if np.isfinite(x).any()}
    if given is None and _on_change(t, series):
        t, signals, Ts, notes = hold(series, base_step(t), where)
        late = [r for r, x in signals.items() if not np.isfinite(x).all()]
        notes += [f"archive: {r.upper()} begins later than OP and PV and is left out" for r in late]
        signals = {r: x for r, x in signals.items() if r not in late}
    else:
        Ts = float(np.median(np.diff(t))) if given is None else float(given)
        t, signals, notes = fill_gaps(t, signals, Ts, where)
    begins = float(t[0]) + (0.0 if t[0] >= began else began)
    if began > CALENDAR:  # events are shared by records of the same time only
        meta["start"] = begins
    if given is None and Ts >= _SLOWEST.get(str(about.get("kind")), _SLOWEST_OF_ANY):
        notes = [*notes, _odd_pace(Ts)]
    about["meta"] = {**meta, **about.get("meta", {})}
    if about.get("kind") is None:
        notes = [*notes, *_kind_by_tag(str(about.get("tag", "")))]
    record = LoopRecord(Ts=Ts, notes=(*sheet.notes, *notes), **signals, **about)
    if not automatic:
        rows = np.rint((recorded - begins) / Ts).astype(int)
        record = replace(record, meta={"rows": rows, **record.meta})
    if held is not None and not automatic and (held == MAN).any():
        times = begins + (np.arange(record.n) + 0.5) * Ts
        manual = held[np.searchsorted(recorded, times) - 1] == MAN
        record = replace(record, meta={"manual": manual, **record.meta})
    return replace(
        record, notes=(*record.notes, *open_span(record, where), *_check_span(record, where))
    )


def _odd_pace(Ts: float) -> str:
    return (
        f"time: Ts = {Ts:g} s is slower than such loops are recorded; if the times count"
        f" milliseconds, add --ts {Ts / 1000.0:g}"
    )


def _kind_by_tag(tag: str) -> list[str]:
    """Return a note on the kind of loop that the letters of a tag propose (ISA-5.1): FIC101 is a
    flow loop.
    """
    found = _LETTERS.search(tag)
    if found is None:
        return []
    kind = _KIND_OF[found[1]]
    return [f"kind: the letters of tag {tag} propose {kind}; --kind {kind} states it"]


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


def _mode_held(modes: np.ndarray, name: str, notes: list[str]) -> np.ndarray | None:
    """Return every sample's mode, None where no word of it is understood: a historian stores a mode
    when it changes.
    """
    known = np.flatnonzero(modes != "")
    if not known.size:
        notes.append(f"mode: {name!r} is not understood and counts for nothing")
        return None
    return modes[np.maximum.accumulate(np.where(modes != "", np.arange(modes.size), known[0]))]


def _option_naming(numbered: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the option that says which columns without a name are signals, and which is the time
    where no other column is.
    """
    cure = example_of_columns(numbered)
    timed = find_time([n for n in names if n not in numbered], {}, "") is not None
    return re.sub(r"t=\d+,", "", cure) if timed else cure


def _automatic(t: np.ndarray, signals: dict[str, np.ndarray], held: np.ndarray, notes: list[str]):
    """Return the longest stretch in automatic or cascade, and say what share of the record either
    is.
    """
    share = {m: float(np.mean(held == m)) for m in (AUTO, CAS, MAN)}
    shares = ", ".join(f"{m} {s:.0%}" for m, s in share.items() if s > 0)
    runs = runs_of(held != MAN)
    lengths = runs[:, 1] - runs[:, 0]
    if share[MAN] == 0.0:
        notes.append(f"mode: {shares} of {held.size} samples")
        return t, signals, 1.0
    if lengths.max(initial=0) < 3:
        notes.append(
            f"mode: {shares}: the controller is never in automatic, which says nothing about cycles"
        )
        return t, signals, 0.0
    a, b = map(int, runs[np.argmax(lengths)])
    part = (
        f"judged samples {a} to {b - 1} of {held.size} ({(b - a) / held.size:.0%}), the longest"
        " stretch in automatic"
    )
    notes.append(f"mode: {shares}; {part}")
    return t[a:b], {role: x[a:b] for role, x in signals.items()}, 1.0 - share[MAN]


def _check_span(record: LoopRecord, where: str) -> list[str]:
    """Refuse a span that is another signal's; note how many samples of a signal lie outside its
    span.
    """
    notes = []
    for name in ("op", "pv"):
        lo, hi = getattr(record, f"{name}_span") or (0.0, 0.0)
        sentence = f"{name.upper()} lies outside {name}_span {lo:g} to {hi:g} in"
        if (share := record.outside(name)) > MOST_OUTSIDE:
            x = getattr(record, name)
            needed = (
                f"it is {x.min():.4g} to {x.max():.4g}; the values that mean 0 and 100 % are needed"
            )
            raise RecordError(f"{where}: {sentence} {share:.0%} of the samples, {needed}")
        if share := record.outside(name, 0.0):
            notes.append(f"span: {sentence} {share:.1%} of the samples")
    return notes


def _read_wide(
    table: _Opened,
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
    series = {role: _known_samples(t, x) for role, x in signals.items()}
    times, signals, Ts = _align_signals(series, Ts, where, sheet.notes, how)
    modes = modes if modes is None else last_known(times, t, modes, "")
    return times, signals, modes, Ts


def _known_samples(t: np.ndarray, x: np.ndarray) -> Series:
    """Return the samples that are known; of two at one time the later one holds."""
    known = np.isfinite(x)
    t = t[known]
    x = x[known]
    last = np.append(np.diff(t) > 0, True)[: t.size]
    return t[last], x[last]


def _join_dates(sheet: Sheet) -> None:
    """Join a column of dates and one of clock times, in both."""
    low = {plain(n): n for n in sheet.columns}
    date, clock = (
        next((low[w] for w in among if w in low), None) for among in (words("date"), words("clock"))
    )
    dates = sheet.columns.get(date or "")
    clocks = sheet.columns.get(clock or "")
    if not date or not clock or not isinstance(dates, list) or not isinstance(clocks, list):
        return
    if any(re.search(r"\d[-/.]\w+[-/.]\d", str(c)) for c in clocks[:1]):
        return  # it holds the date already
    if (
        parts := next((sheet.columns[low[w]] for w in _MILLISECONDS if w in low), None)
    ) is not None:
        clocks = [
            f"{c}.{int(ms):03d}" if str(ms).isdigit() else c
            for c, ms in zip(clocks, parts, strict=True)
        ]
    sheet.columns[date] = sheet.columns[clock] = [
        f"{str(d).strip().split(' ')[0]} {str(c).strip()}"
        for d, c in zip(dates, clocks, strict=True)
    ]


def _read_long(
    table: _Opened,
    roles: dict[str, str],
    chosen: Mapping[str, str],
    Ts: float | None,
    how: str | None = None,
):
    """Read a table whose signals have separate times, as `_read_wide` does another."""
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
    if Ts is None and (full or _on_change(times, series)):
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


def _on_change(t: np.ndarray, series: Mapping[str, Series]) -> bool:
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

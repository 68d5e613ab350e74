"""Read the tables of a run: all rows, one scenario, or everything as arrays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from simbench.bench.store.checksums import (
    RunError,
    check_tables,
    refuse_unfinished,
    table_files,
    verified,
)
from simbench.bench.store.manifest import read_manifest
from simbench.bench.store.place import Place, place_of
from simbench.bench.store.tables import AXES, CELL_S_OVER_2J, RANKED, SCENARIOS, VERDICT_SCHEMA
from simbench.detectors.errors import nearest
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.scenarios.spec import Loop, Scenario

TRUTHS = ("sticky", "predicted", "cycled")
CODES = {NO_STICTION: 0, STICTION: 1, NO_DECISION: 2}
_WORDS = ("block", "member", "process", "controller", "valve", "disturbance", "tuning", "echo")
_CODED = {
    "scenarios": (*_WORDS, "cycled"),
    "verdicts": ("scenario_id", "method", "verdict"),
}
_NUMBERS = (*(axis for axis in AXES if axis not in _WORDS), CELL_S_OVER_2J, RANKED)
ID = np.dtype("S16")
_ENDS = ("S_lo", "S_hi", "J_lo", "J_hi")
# as baselines keep them
LEVELS = np.dtype([("loop", np.int64), ("method", np.int64), *((end, np.float32) for end in _ENDS)])


def parts(
    folder: str | Path | Place,
    kind: str,
    columns: Sequence[str] | None = None,
    manifest: Mapping[str, Any] | None = None,
    coded: Sequence[str] = (),
) -> Iterator[pa.Table]:
    """Yield a table of a run or baseline part by part; whole scenarios in every part, no more than
    one in memory. Of the columns in `coded` few values differ: they stay numbers of these.
    """
    place = place_of(folder)
    if manifest is None:
        manifest = read_manifest(place)
        refuse_unfinished(place, manifest)
    for name, mark in table_files(place, manifest, kind):
        content = pa.BufferReader(verified(place, name, mark))
        source = pq.ParquetFile(content, read_dictionary=list(coded))
        for i in range(source.num_row_groups):
            # small parts: threads cost more than they save
            yield source.read_row_group(
                i, columns=None if columns is None else list(columns), use_threads=False
            )


def read_table(
    folder: str | Path | Place,
    kind: str,
    columns: Sequence[str] | None = None,
    only: pc.Expression | None = None,
) -> pa.Table:
    """Return the rows of a table of a run or baseline for which an expression is true; parameters
    and errors as `parts`.
    """
    chosen = [part if only is None else part.filter(only) for part in parts(folder, kind, columns)]
    schema = {"scenarios": SCENARIOS, "verdicts": VERDICT_SCHEMA}[kind]
    empty = schema.empty_table().select(list(columns or schema.names))
    return pa.concat_tables([t.replace_schema_metadata() for t in chosen or [empty]])


def read_scenario(path: str | Path, scenario_id: str) -> Scenario:
    """Return one scenario of a run, from which its record can be simulated again."""
    check_tables(path, read_manifest(path))
    known: list[str] = []
    rows: list[dict[str, Any]] = []
    for part in parts(path, "scenarios", ["scenario_id", "loop", "seed", "tags"]):
        known += part.column("scenario_id").to_pylist()
        rows += part.filter(pc.field("scenario_id") == scenario_id).to_pylist()
    if not rows:
        close = (
            nearest(scenario_id, known)
            if len(known) < 50
            else f"it has {len(known)} others, see scenarios.parquet"
        )
        raise RunError(f"{path} has no scenario {scenario_id!r}: {close}")
    row = rows[0]
    scenario = Scenario(
        loop=Loop.from_table(json.loads(row["loop"])),
        seed=row["seed"],
        tags=json.loads(row["tags"]),
    )
    if scenario.id != scenario_id:
        raise RunError(
            f"{path}: the loop of scenario {scenario_id!r} is not the one that was run (its id is"
            f" {scenario.id!r})"
        )
    return scenario


@dataclass(frozen=True, eq=False)
class RunArrays:
    """A run's tables as arrays: n scenarios, m methods."""

    manifest: dict[str, Any]  # of the run
    ids: np.ndarray  # (n,) scenario ids
    hashes: np.ndarray  # (n,) of the records
    places: np.ndarray  # (n,) cell, repeat and member: the place of a scenario in its grid
    # (n,) grid axes and other tags: numbers (NaN where there is none) or words
    axes: dict[str, np.ndarray]
    # (n,) sticky, predicted, cycled: 1 positive, 0 negative, -1 left out; `cycled_word` holds the
    # four words
    truth: dict[str, np.ndarray]
    oscillating: np.ndarray  # (n,) answer of the common front end
    # (n,) cell and repeat: the loops of one group are alike in what the cell sets
    groups: np.ndarray
    # (n, k) what a record tells without its waveform, as `simbench.bench.score.no_waveform` names
    # it
    design: np.ndarray
    methods: tuple[str, ...]  # method ids
    verdict: np.ndarray  # (m, n) 0 no_stiction, 1 stiction, 2 no_decision
    # (m, n) NaN where there is none, -inf where there is no oscillation
    score: np.ndarray
    # (m, n) whether the method's source covers the loop: 1 yes, 0 no, -1 the record does not tell
    applicable: np.ndarray
    failed: np.ndarray  # (m, n) whether the detector raised an error
    runtime: np.ndarray  # (m, n) seconds
    # (n, 2) mapped S and J of the valve (% of travel); NaN in baselines that kept none
    friction: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    # (k,) every S and J that a method gave, with the numbers of loop and method; the ends of an
    # interval, or twice a number
    levels: np.ndarray = field(default_factory=lambda: np.empty(0, LEVELS))

    @property
    def apart(self) -> np.ndarray:
        """Which loops no ranking counts."""
        return self.axes[RANKED] == 0.0

    @classmethod
    def read(cls, path: str | Path | Place, manifest: dict[str, Any] | None = None) -> RunArrays:
        """Read a finished run."""
        place = place_of(path)
        manifest = read_manifest(place) if manifest is None else manifest
        refuse_unfinished(place, manifest)
        grid = _scenario_columns(place, manifest)
        return cls(
            manifest,
            **grid,
            methods=tuple(manifest["methods"]),
            **_verdict_columns(place, manifest, grid["ids"]),
        )


def _scenario_columns(place: Place, manifest: Mapping[str, Any]) -> dict[str, Any]:
    n = manifest["counts"]["scenarios"]
    ids, hashes, cycled = np.empty(n, dtype=ID), np.empty(n, dtype=ID), np.empty(n, dtype=object)
    axes: dict[str, np.ndarray] = {
        a: np.empty(n, dtype=object if a in _WORDS else float) for a in (*_WORDS, *_NUMBERS)
    }
    truth = {t: np.empty(n, dtype=np.int8) for t in TRUTHS}
    oscillating, places = np.empty(n, dtype=bool), [np.empty(0, dtype="S")]
    groups, friction, design = np.empty(n, dtype=np.int64), np.full((n, 2), np.nan), []
    columns = [
        "scenario_id",
        "record_hash",
        "cell",
        "repeat",
        "group",
        *axes,
        *TRUTHS,
        "oscillating",
        "no_waveform",
        "S",
        "J",
    ]
    for rows, part in _sliced(place, manifest, "scenarios", columns, n):
        ids[rows], hashes[rows] = _ids(part.column("scenario_id")), _ids(part.column("record_hash"))
        for name in _WORDS:
            axes[name][rows] = _words(part.column(name))
        for name in _NUMBERS:
            axes[name][rows] = part.column(name).to_numpy(zero_copy_only=False)
        for name in ("sticky", "predicted"):
            truth[name][rows] = _flags(part.column(name))
        of = (part.column(c).cast(pa.string()) for c in ("cell", "repeat", "member"))
        joined = pc.binary_join_element_wise(
            *of, "/", null_handling="replace", null_replacement="None"
        )
        places.append(np.array(joined.to_pylist(), dtype="S"))
        cycled[rows] = _words(part.column("cycled"))
        oscillating[rows] = _flags(part.column("oscillating")) == 1
        groups[rows] = part.column("group").to_numpy()
        design.append(_lists(part))
        if "S" in part.column_names:  # baselines written before have none
            friction[rows] = np.column_stack(
                [part.column(name).to_numpy(zero_copy_only=False) for name in ("S", "J")]
            )
    truth["cycled"][:] = np.select([cycled == "yes", cycled == "no"], [1, 0], -1)
    truth["cycled_word"] = cycled
    width = max((block.shape[1] for block in design), default=1)
    padded = (np.pad(b, ((0, 0), (0, width - b.shape[1]))) for b in design)
    return {
        "ids": ids,
        "hashes": hashes,
        "places": np.concatenate(places),
        "axes": axes,
        "truth": truth,
        "oscillating": oscillating,
        "groups": groups,
        "design": np.concatenate([np.zeros((0, width)), *padded]),
        "friction": friction,
    }


def _verdict_columns(
    place: Place, manifest: Mapping[str, Any], ids: np.ndarray
) -> dict[str, np.ndarray]:
    methods, n = list(manifest["methods"]), ids.size
    kinds = {"verdict": np.int8, "score": float, "applicable": np.int8}
    out = {name: np.empty((len(methods), n), dtype=kind) for name, kind in kinds.items()}
    out.update(
        failed=np.empty((len(methods), n), dtype=bool),
        runtime=np.empty((len(methods), n), dtype=np.float32),
    )
    columns, levels = (
        ["scenario_id", "method", *kinds, "error", "runtime_s", *_ENDS],
        [np.empty(0, LEVELS)],
    )
    for rows, part in _sliced(place, manifest, "verdicts", columns, n, max(len(methods), 1)):
        _check_order(part, ids[rows], methods, place)
        arrays = {"verdict": _codes(part.column("verdict"))}
        arrays["score"] = part.column("score").to_numpy(zero_copy_only=False)
        arrays["applicable"] = _flags(part.column("applicable"))
        arrays["failed"] = part.column("error").is_valid().to_numpy(zero_copy_only=False)
        arrays["runtime"] = part.column("runtime_s").to_numpy(zero_copy_only=False)
        for name, values in arrays.items():
            out[name][:, rows] = values.reshape(-1, len(methods)).T
        levels.append(_levels(part, rows.start, len(methods)))
    return {**out, "levels": np.concatenate(levels)}


def _levels(part: pa.Table, start: int, methods: int) -> np.ndarray:
    """Return the rows of a part in which a method gave S or J."""
    ends = np.column_stack(
        [part.column(end).cast(pa.float64()).to_numpy(zero_copy_only=False) for end in _ENDS]
    )
    given = np.flatnonzero(~np.isnan(ends).all(axis=1))
    levels = np.empty(given.size, LEVELS)
    levels["loop"], levels["method"] = start + given // methods, given % methods
    for k, end in enumerate(_ENDS):
        levels[end] = ends[given, k]
    return levels


def _sliced(
    place: Place,
    manifest: Mapping[str, Any],
    kind: str,
    columns: Sequence[str],
    n: int,
    each: int = 1,
) -> Iterator[tuple[slice, pa.Table]]:
    """Yield a table's parts, each with the scenarios it holds; raise RunError unless all n of them
    come.
    """
    start = 0
    for part in parts(place, kind, columns, manifest, _CODED[kind]):
        size, odd = divmod(part.num_rows, each)
        if odd or start + size > n:
            break
        yield slice(start, start + size), part
        start += size
    else:
        if start == n:
            return
    raise RunError(
        f"{place} is damaged: {kind} do not hold the {each} rows needed for each of {n} scenarios;"
        " run it again"
    )


def _check_order(part: pa.Table, ids: np.ndarray, methods: Sequence[str], place: Place) -> None:
    names, codes = _coded(part.column("method"))
    order = np.array([methods.index(name) if name in methods else -1 for name in names])[
        codes
    ].reshape(-1, len(methods))
    names, codes = _coded(part.column("scenario_id"))
    actual = np.array(names, dtype=ID)[codes].reshape(-1, len(methods))
    if not (order == np.arange(len(methods))).all() or not (actual == ids[:, None]).all():
        raise RunError(f"{place} is damaged: verdicts and scenarios do not match; run it again")


def _lists(part: pa.Table) -> np.ndarray:
    """Return the lists of numbers of a part's scenarios as rows; zeros where there is none."""
    # baselines written before have none
    if "no_waveform" not in part.column_names or not part.num_rows:
        return np.zeros((part.num_rows, 1))
    column = part.column("no_waveform").combine_chunks()
    there, values = (
        column.is_valid().to_numpy(zero_copy_only=False),
        column.flatten().to_numpy(zero_copy_only=False),
    )
    rows = np.zeros((part.num_rows, max(values.size // max(int(there.sum()), 1), 1)))
    if there.any():
        rows[there] = values.reshape(int(there.sum()), -1)
    return rows


def _ids(column: pa.ChunkedArray) -> np.ndarray:
    text = column.combine_chunks()
    text = text.chunk(0) if isinstance(text, pa.ChunkedArray) else text
    if len(text) and not text.null_count:
        _, ends, content = text.buffers()
        ends = np.frombuffer(ends, np.int32, len(text) + 1, 4 * text.offset)
        if (np.diff(ends) == ID.itemsize).all():  # as they lie in memory
            return np.frombuffer(content, ID, len(text), int(ends[0]))
    return np.array([t or "" for t in text.to_pylist()], dtype=ID)


def _coded(column: pa.ChunkedArray) -> tuple[list[str], np.ndarray]:
    """The different values of a column, "" for null at their end, and which of them is
    where.
    """
    coded = column.dictionary_encode().unify_dictionaries().combine_chunks()
    coded = coded.chunk(0) if isinstance(coded, pa.ChunkedArray) else coded
    names = [*coded.dictionary.to_pylist(), ""]
    codes = coded.indices
    codes = codes.fill_null(len(names) - 1) if codes.null_count else codes
    return names, codes.to_numpy(zero_copy_only=False)


def _words(column: pa.ChunkedArray) -> np.ndarray:
    names, codes = _coded(column)
    # objects: all rows share a few strings
    return np.array(names, dtype=object)[codes]


def _codes(column: pa.ChunkedArray) -> np.ndarray:
    names, codes = _coded(column)
    return np.array([CODES.get(name, -1) for name in names], dtype=np.int8)[codes]


def _flags(column: pa.ChunkedArray) -> np.ndarray:
    return column.cast(pa.int8()).fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int8)

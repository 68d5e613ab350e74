"""Read the tables of a run: all rows, one scenario, or everything as arrays."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from simbench.bench.store.folder import (
    AGAIN,
    PIECES,
    RunError,
    digest,
    refuse_unfinished,
    table_files,
)
from simbench.bench.store.manifest import read_manifest
from simbench.bench.store.tables import AXES, CELL_S_OVER_2J, RANKED, WORD_COLUMNS
from simbench.detectors.errors import nearest
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.scenarios.spec import Loop, Scenario

_BY_METHOD = ("verdict", "score", "applicable", "failed", "runtime", "sizes")  # loops in columns
COPIES = "copies"  # key of a manifest in memory: loops that were left out as copies of others
_DEFINITION = ("scenario_id", "loop", "seed", "tags")  # columns that make a scenario
TRUTHS = ("sticky", "predicted", "cycled")
CODES = {NO_STICTION: 0, STICTION: 1, NO_DECISION: 2}
_CYCLED = {"yes": 1, "no": 0}
_NUMBERS = (*(axis for axis in AXES if axis not in WORD_COLUMNS), CELL_S_OVER_2J, RANKED)
# values of an axis of a grid's own, beyond which a run is not scored by it
_MOST_ALONG = 200
ENDS = ("S_lo", "S_hi", "J_lo", "J_hi")
# what is read into arrays: columns of which few values differ, which stay numbers of these, and
# others
_COLUMNS = {
    "scenarios": (
        (WORD_COLUMNS + ("cycled",)),
        (
            (("scenario_id", "loop_digest", "record_hash", "cell", "repeat", "group") + _NUMBERS)
            + ("sticky", "predicted", "oscillating", "no_waveform", "S", "J")
        ),
    ),
    "verdicts": (
        ("scenario_id", "method", "verdict"),
        (("score", "applicable", "error", "runtime_s") + ENDS),
    ),
}


def read_table(
    folder: str | Path,
    kind: str,
    columns: Sequence[str] | None = None,
    only: pc.Expression | None = None,
) -> pa.Table:
    """Return the rows of a table of a run or baseline for which an expression is true."""
    folder = Path(folder)
    parts = table_parts(folder, kind, read_manifest(folder), columns)
    try:
        return _concatenate(part if only is None else part.filter(only) for part in parts)
    except pa.ArrowException as error:
        raise RunError(
            f"{folder} is damaged: table {kind} {_first_line(error)}; it is needed as it was"
            " written: restore it, or run it again"
        ) from None


def _concatenate(parts: Iterable[pa.Table]) -> pa.Table:
    return pa.concat_tables(part.replace_schema_metadata() for part in parts)


def table_parts(
    folder: Path,
    kind: str,
    manifest: Mapping[str, Any],
    columns: Sequence[str] | None = None,
    coded: Sequence[str] = (),
) -> Iterator[pa.Table]:
    """Yield a table of a run or baseline file by file, whole scenarios in each; RunError where one
    is not as it was written.
    """
    # which files there are, and what the manifest states of them
    refuse_unfinished(folder, manifest)
    files = table_files(folder, manifest, kind)
    if not files:
        raise RunError(
            f"{folder} is damaged: table {kind} has no file, which is needed; run it again"
        )
    stated = [receipt["digests"][kind] for receipt in manifest.get(PIECES, ())]

    # each is held against its digest, where one is stated, before it is read
    for file, needed in zip_longest(files, stated):
        try:
            # as bytes: the name of a folder may be no text
            content = file.read_bytes()
            if needed not in (None, digest(content)):
                raise pa.ArrowInvalid(f"its digest is {digest(content)}, {needed} is stated")
            source = pq.ParquetFile(
                pa.BufferReader(content),
                read_dictionary=list(coded),
                page_checksum_verification=True,
            )
            # small parts: threads cost more than they save
            yield source.read(columns=None if columns is None else list(columns), use_threads=False)
        except (OSError, pa.ArrowException, LookupError) as error:
            if isinstance(error, FileNotFoundError):
                why = "is missing"
            else:
                why = _first_line(error)
            raise RunError(
                f"{folder} is damaged: {file.relative_to(folder)} {why}; it is needed as it"
                f" was written: restore it, or {AGAIN}"
            ) from None


def _first_line(error: Exception) -> str:
    return f"cannot be read ({' '.join(str(error).split())[:200]})"


def _parts_for_arrays(
    folder: Path, kind: str, manifest: Mapping[str, Any], *more: str
) -> Iterator[pa.Table]:
    """Yield what of a table's files is read into arrays."""
    coded, others = _COLUMNS[kind]
    return table_parts(folder, kind, manifest, tuple(coded) + tuple(others) + more, coded)


def read_scenario(path: str | Path, scenario_id: str) -> Scenario:
    """Return one scenario of a run, from which its record can be simulated again."""
    table = read_table(path, "scenarios", [*_DEFINITION, "loop_digest"])
    rows = table.filter(pc.field("scenario_id") == scenario_id).to_pylist()
    if not rows:
        known = table.column("scenario_id").to_pylist()
        if len(known) < 50:
            close = nearest(scenario_id, known)
        else:
            close = f"it has {len(known)} others, see scenarios.parquet"
        raise RunError(f"{path} has no scenario {scenario_id!r}: {close}")
    return scenario_of(rows[0], str(path))


def without_loops(where: str) -> RunError:
    """Return the error of who asks a folder of shipped verdicts for a loop."""
    return RunError(
        f"{where} holds verdicts that simbench ships, without the loops, which are those of its"
        f" grid; simulate them with `simbench run {Path(where).name}`"
    )


def scenario_of(row: Mapping[str, Any], where: str) -> Scenario:
    """Return the scenario of a row of the scenarios table; RunError where its loop is not the one
    that was run.
    """
    # The scenario as it was stored, and the digest that it had
    if row["loop"] is None:
        raise without_loops(where)
    scenario = Scenario(
        loop=Loop.from_table(json.loads(row["loop"])),
        seed=row["seed"],
        tags=json.loads(row["tags"]),
        asked=row["scenario_id"],
    )
    if scenario.loop_digest != row["loop_digest"]:
        raise RunError(
            f"{where}: the loop of scenario {scenario.id!r} is not the one that was run (its digest"
            f" is {scenario.loop_digest!r}, {row['loop_digest']!r} is needed)"
        )
    return scenario


@dataclass(frozen=True, eq=False)
class RunArrays:
    """A run's tables as arrays: n scenarios, m methods."""

    manifest: dict[str, Any]  # of the run
    ids: np.ndarray  # (n,) scenario ids
    digests: np.ndarray  # (n,) of loop and seed
    hashes: np.ndarray  # (n,) of the records
    # (n,) grid axes, those of a loop's own grid ("valve.S"), and other tags: numbers (NaN where
    # there is none) or words
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
    # (4, m, n) the S and J that a method gave, by `ENDS`: of an interval, or twice a number; NaN
    # where it gave none
    sizes: np.ndarray = field(default_factory=lambda: np.empty((4, 0, 0)))

    @property
    def table(self) -> list[tuple[str, str]]:
        """Id and loop digest of every scenario."""
        pairs = zip(self.ids.tolist(), self.digests.tolist(), strict=True)
        return [(ident.decode(), digest.decode()) for ident, digest in pairs]

    @property
    def apart(self) -> np.ndarray:
        """Which loops no ranking counts."""
        return self.axes[RANKED] == 0.0

    @property
    def along(self) -> tuple[str, ...]:
        """The axes by which a run is scored."""
        return (*AXES, *(name for name in _own_axes(self.manifest) if name in self.axes))

    def without_copies(self) -> RunArrays:
        """Return a run with one loop, that of the least id, for each record that several hold bit
        for bit with the same labels; its manifest states how many it had.
        """
        import pandas as pd

        # what makes two loops one; a loop that could not be simulated has no record
        labels = {}
        for truth in TRUTHS:
            labels[truth] = self.truth[truth]
        loops = pd.DataFrame({"id": self.ids, "record": self.hashes, **labels}).sort_values("id")
        copy = loops.duplicated(["record", *TRUTHS]) & (loops["record"] != b"")
        if not copy.any():
            return self

        # every array without the copies
        kept = np.sort(loops.index[~copy])
        arrays: dict[str, Any] = {}
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray) and values.size:
                arrays[name] = np.take(values, kept, -1 if name in _BY_METHOD else 0)
        for name in ("axes", "truth"):
            arrays[name] = {key: values[kept] for key, values in getattr(self, name).items()}
        return replace(self, manifest={**self.manifest, COPIES: int(copy.sum())}, **arrays)

    @classmethod
    def read(cls, path: str | Path, manifest: dict[str, Any] | None = None) -> RunArrays:
        """Read a finished run."""
        # The manifest, and the scenarios in their order
        folder = Path(path)
        if manifest is None:
            manifest = read_manifest(folder)
        refuse_unfinished(folder, manifest)
        methods = tuple(manifest["methods"])
        n = manifest["counts"]["scenarios"]
        own = _own_axes(manifest)
        if own:
            tags = ["tags"]
        else:
            tags = []
        scenarios = _concatenate(_parts_for_arrays(folder, "scenarios", manifest, *tags))
        ids = scenarios.column("scenario_id").to_pylist()

        # The verdicts of each piece belong to its scenarios, method by method
        said = []
        start = 0
        for part in _parts_for_arrays(folder, "verdicts", manifest):
            size = part.num_rows // max(len(methods), 1)
            some = ids[start : start + size]
            match = _follows_names(part.column("scenario_id"), some, np.repeat, len(methods))
            match &= _follows_names(part.column("method"), list(methods), np.tile, size)
            said.append(dict(_of_verdicts(part, (len(methods), size))) if match else {})
            start += size

        # A piece that does not fit was damaged
        if not start == len(ids) == n or not all(said):
            raise RunError(
                f"{folder} is damaged: verdicts and scenarios do not match; the verdicts of"
                f" {len(methods)} methods are needed for each of {n} scenarios: run it again"
            )

        # One array per column over all pieces
        wide = {}
        for name in said[0]:
            wide[name] = np.concatenate([s[name] for s in said], axis=-1)
        tall = dict(_of_scenarios(scenarios))
        tall["axes"] = {**dict(_along_own(scenarios, own)), **tall["axes"]}
        return cls(manifest, methods=methods, **tall, **wide)


def _of_scenarios(table: pa.Table) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of a run that its scenarios give."""
    # Hashes as bytes
    keys = {"ids": "scenario_id", "digests": "loop_digest", "hashes": "record_hash"}
    for name, column in keys.items():
        yield name, np.array([x or "" for x in table.column(column).to_pylist()], dtype="S16")

    # The axes
    axes = {}
    for name in WORD_COLUMNS:
        axes[name] = _of_words(table.column(name))
    yield "axes", axes | {name: _read_numbers(table.column(name)) for name in _NUMBERS}

    # The truths
    truth = {}
    for name in ("sticky", "predicted"):
        truth[name] = _read_flags(table.column(name))
    truth["cycled"] = _encode_words(table.column("cycled"), _CYCLED)
    yield "truth", truth | {"cycled_word": _of_words(table.column("cycled"))}

    # What the record shows, and what it is made of
    yield "oscillating", _read_flags(table.column("oscillating")) == 1
    yield "groups", table.column("group").to_numpy()
    yield "design", _read_lists(table.column("no_waveform"))
    yield "friction", np.column_stack([_read_numbers(table.column(name)) for name in "SJ"])


def _own_axes(manifest: Mapping[str, Any]) -> list[str]:
    """Return the axes of a run's grid that other grids have not: keys and sections of its loops."""
    grid = manifest.get("grid_content", {})
    tables = [part.get("axes") or {} for part in (grid, *(grid.get("block") or ()))]
    few = []
    for axes in tables:
        for key, values in axes.items():
            if len(values) <= _MOST_ALONG:
                few.append(key)
    return [key for key in dict.fromkeys(few) if key not in AXES]


def _along_own(table: pa.Table, axes: Sequence[str]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the values that scenarios have on such axes, which all scenarios of a cell share."""
    if not axes:
        return
    _, first, cell = np.unique(table.column("cell"), return_index=True, return_inverse=True)
    tags = [json.loads(table.column("tags")[int(k)].as_py()) for k in first]
    for axis in axes:
        values = [one.get(axis) for one in tags]
        words = any(isinstance(value, str) for value in values)
        if words:
            known = ["" if v is None else str(v) for v in values]
        else:
            known = values
        yield axis, np.array(known, dtype=object if words else float)[cell]


def _of_verdicts(table: pa.Table, shape: tuple[int, int]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of a run that its verdicts give, with the shape (methods, scenarios)."""

    def by_method(values: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(values.reshape(shape[::-1]).T)

    yield "verdict", by_method(_encode_words(table.column("verdict"), CODES))
    yield "score", by_method(_read_numbers(table.column("score")))
    yield "applicable", by_method(_read_flags(table.column("applicable")))
    yield "failed", by_method(table.column("error").is_valid().to_numpy())
    yield "runtime", by_method(_read_numbers(table.column("runtime_s")).astype(np.float32))
    ends = [by_method(_read_numbers(table.column(end)).astype(np.float32)) for end in ENDS]
    yield "sizes", np.array(ends)


def _follows_names(column: pa.ChunkedArray, names: list[str], repeated: Any, times: int) -> bool:
    """Return whether a column holds names in their order, each of them or all so many times."""
    if not len(column):  # of a piece whose echoes were all left out
        return not len(names) * times
    values, codes = _encode(column)
    return values == names and np.array_equal(codes, repeated(np.arange(len(names)), times))


def _encode(column: pa.ChunkedArray) -> tuple[list[str], np.ndarray]:
    """Return the different values of a column in the order in which they come, and which of them
    is where, one more than there are for null.
    """
    coded = column.unify_dictionaries().combine_chunks()
    if isinstance(coded, pa.ChunkedArray):
        coded = coded.chunk(0)
    names = coded.dictionary.to_pylist()
    codes = coded.indices
    # which takes a while
    if codes.null_count:
        codes = codes.fill_null(len(names))
    return names, codes.to_numpy(zero_copy_only=False)


def _of_words(column: pa.ChunkedArray) -> np.ndarray:
    """Return the words of a column, "" for null."""
    names, places = _encode(column)
    # objects: all rows share a few strings
    return np.array(names + [""], dtype=object)[places]


def _encode_words(column: pa.ChunkedArray, codes: Mapping[str, int]) -> np.ndarray:
    """Return the codes of a column's words, -1 of others and for null."""
    names, places = _encode(column)
    return np.array([codes.get(name, -1) for name in names] + [-1], dtype=np.int8)[places]


def _read_numbers(column: pa.ChunkedArray) -> np.ndarray:
    return column.cast(pa.float64()).to_numpy(zero_copy_only=False)


def _read_flags(column: pa.ChunkedArray) -> np.ndarray:
    return column.cast(pa.int8()).fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int8)


def _read_lists(column: pa.ChunkedArray) -> np.ndarray:
    """Return a column's lists of numbers as rows; zeros where there is none."""
    there = column.is_valid().to_numpy()
    values = column.combine_chunks().flatten().to_numpy(zero_copy_only=False)
    rows = np.zeros((there.size, max(values.size // max(int(there.sum()), 1), 1)))
    if there.any():
        rows[there] = values.reshape(int(there.sum()), -1)
    else:
        rows[there] = 0.0
    return rows


def read_book(folder: str | Path) -> RunArrays:
    """Read a run or a baseline."""
    # Whatever a damaged file raises is one sentence
    try:
        book = RunArrays.read(folder)
    except (
        pa.ArrowException,
        OSError,
        ArithmeticError,
        LookupError,
        TypeError,
        ValueError,
    ) as error:
        raise RunError(
            f"{folder} is damaged: {' '.join(str(error).split())[:200]}; restore it, or run it"
            " again"
        ) from None

    # A run without verdicts answers nothing
    if not book.ids.size or not book.methods:
        raise RunError(
            f"{folder} holds no verdicts: {book.ids.size} scenarios, {len(book.methods)} methods;"
            " run it again"
        )
    return book

"""A run's folder: finished pieces, the two final tables, and reading them back."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from detectors.errors import nearest
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from scenarios.spec import Loop, Scenario
from simbench.bench.checksums import TABLES, RunError, check_tables, digest, file_digest, opened, sealed
from simbench.bench.manifest import MANIFEST, read_manifest, refuse_to_mix, write_manifest
from simbench.bench.tables import AXES, FORMAT
from simbench.bench.work import Piece
from simbench.files import folder as make_folder
from simbench.files import whole_file, write_record

PARTS = "parts"
KINDS = ("verdicts", "scenarios")
TRUTHS = ("sticky", "predicted", "cycled")
CODES = {NO_STICTION: 0, STICTION: 1, NO_DECISION: 2}
# uncompressed bytes of a row group: it waits in memory, but so does what parquet notes of every row group already written
ROW_GROUP = 4_000_000


def open_run(path: str | Path, manifest: dict[str, Any], resume: bool) -> Path:
    """Make or reopen a run's folder.

    Parameters
    ----------
    path : str or Path
        The folder.
    manifest : dict
        What is about to run.
    resume : bool
        Go on with what is there.

    Returns
    -------
    Path

    Raises
    ------
    RunError
        When the folder holds something else, or a run that differs (and in what).
    """
    where = make_folder(path)
    sweep(where)
    if not any(where.iterdir()):
        write_manifest(where, manifest)
    elif not (where / MANIFEST).exists():
        raise RunError(f"folder {where} is not empty and holds no run; choose another")
    elif not resume:
        raise RunError(f"folder {where} already holds a run; continue it with --resume, or choose another folder")
    else:
        refuse_to_mix(where, manifest)
    make_folder(where / PARTS)
    sweep(where / PARTS)
    return where


def sweep(folder: Path) -> None:
    """Remove what a killed process left half-written: `.NAME.PID` of a process that is gone."""
    for file in folder.glob(".*.[0-9]*"):
        number = file.suffix[1:]
        if number.isdigit() and not Path(f"/proc/{number}").exists():
            with contextlib.suppress(OSError):
                file.unlink()


def write_piece(where: Path, piece: Piece, key: str) -> None:
    """Put a finished piece on disk; it counts from the moment its seal, the last file, stands under its name.

    Parameters
    ----------
    where : Path
        Folder of the run.
    piece : Piece
    key : str
        Of the run, see `simbench.bench.manifest.run_key`: a piece of another run never counts.
    """
    for ident, record in piece.kept:
        write_record(record, make_folder(where / "records") / f"{ident}.csv")
    for kind in KINDS:
        with whole_file(part_file(where, piece.number, kind), "wb") as f:
            f.write(getattr(piece, kind))
    marks = {kind: digest(getattr(piece, kind)) for kind in KINDS}
    with whole_file(seal_file(where, piece.number)) as f:
        json.dump(sealed({"run": key, "piece": piece.number, **marks}), f)


def is_whole(where: Path, number: int, key: str) -> bool:
    """Whether a piece of this run stands on disk in all its files, bit for bit as it was written."""
    try:
        seal = opened(json.loads(seal_file(where, number).read_text(encoding="utf-8")), "seal")
        if (seal["run"], seal["piece"]) != (key, number):
            return False
        return all(file_digest(part_file(where, number, kind)) == seal[kind] for kind in KINDS)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, RunError):
        return False


def read_part(where: Path, number: int, kind: str, columns: list[str] | None = None) -> pa.Table:
    """Return one table of a piece; raise RunError when it is not what its seal says."""
    try:
        content = part_file(where, number, kind).read_bytes()
        seal = opened(json.loads(seal_file(where, number).read_text(encoding="utf-8")), seal_file(where, number))
        if digest(content) == seal[kind]:
            return pq.read_table(io.BytesIO(content), columns=columns)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"piece {number} of {where} cannot be read: {error}; continue with --resume") from None
    raise RunError(f"piece {number} of {where} is not what was written; continue with --resume")


def finish(where: Path, pieces: int, manifest: dict[str, Any]) -> None:
    """Join the pieces to the final tables, one row group in memory at a time, and say in the manifest that the run is whole."""
    records, counts = hashlib.sha256(), {"scenarios": 0, "verdicts": 0, "errors": 0}
    for kind in KINDS:
        with whole_file(where / f"{kind}.parquet", "wb") as f:
            writer, held, size = None, [], 0
            for number in range(pieces):
                table = read_part(where, number, kind).replace_schema_metadata({"format": str(FORMAT)})
                writer = writer or pq.ParquetWriter(f, table.schema, compression="zstd")
                held.append(table)
                size += table.nbytes
                if number == pieces - 1 or size >= ROW_GROUP:
                    writer.write_table(pa.concat_tables(held))
                    held, size = [], 0
                counts[kind] += table.num_rows
                counts["errors"] += table.num_rows - table.column("error").null_count
                if kind == "scenarios":
                    records.update("".join(h or "-" for h in table.column("record_hash").to_pylist()).encode())
            if writer is not None:
                writer.close()
    about = {"counts": counts, "records_hash": records.hexdigest()[:16]}
    about[TABLES] = {kind: file_digest(where / f"{kind}.parquet") for kind in KINDS}
    write_manifest(where, {**manifest, "complete": True, **about})
    shutil.rmtree(where / PARTS)


def read_scenario(path: str | Path, scenario_id: str) -> Scenario:
    """Return one scenario of a run, from which its record can be simulated again.

    Parameters
    ----------
    path : str or Path
        Folder of a finished run.
    scenario_id : str
        Its id.

    Returns
    -------
    Scenario

    Raises
    ------
    RunError
        When the run has no such scenario; the nearest id is named.
    """
    file = _table(path, "scenarios")
    check_tables(path, read_manifest(path))
    found = pq.read_table(file, columns=["loop", "seed", "tags"], filters=[("scenario_id", "=", scenario_id)]).to_pylist()
    if not found:
        known = pq.read_table(file, columns=["scenario_id"]).column(0).to_pylist()
        close = nearest(scenario_id, known) if len(known) < 50 else f"it has {len(known)} others, see scenarios.parquet"
        raise RunError(f"{path} has no scenario {scenario_id!r}: {close}")
    row = found[0]
    scenario = Scenario(loop=Loop.from_table(json.loads(row["loop"])), seed=row["seed"], tags=json.loads(row["tags"]))
    if scenario.id != scenario_id:
        raise RunError(f"{path}: the loop of scenario {scenario_id!r} is not the one that was run (its id is {scenario.id!r})")
    return scenario


@dataclass(frozen=True, eq=False)
class Book:
    """A run's tables as arrays: n scenarios, m methods.

    Parameters
    ----------
    manifest : dict
        Of the run.
    ids : ndarray of bytes, shape (n,)
        Scenario ids.
    hashes : ndarray of bytes, shape (n,)
        Of the records.
    places : ndarray of str, shape (n,)
        Cell, repeat and member: where in its grid a scenario stands.
    axes : dict of str to ndarray, shape (n,)
        Grid axes and other tags: numbers (NaN where there is none) or words.
    truth : dict of str to ndarray of int8, shape (n,)
        sticky, predicted, cycled: 1 positive, 0 negative, -1 left out; `cycled_word` holds the four words.
    oscillating : ndarray of bool, shape (n,)
        What the common front end said.
    methods : tuple of str
        Method ids.
    verdict, verdict_raw : ndarray of int8, shape (m, n)
        0 no_stiction, 1 stiction, 2 no_decision; with and without front end.
    score, score_raw : ndarray, shape (m, n)
        NaN where there is none; with the front end, -inf where it found no oscillation.
    applicable : ndarray of int8, shape (m, n)
        Whether the method's source covers the loop: 1 yes, 0 no, -1 the record does not tell.
    failed : ndarray of bool, shape (m, n)
        Whether the detector raised an error.
    runtime : ndarray of float32, shape (m, n)
        Seconds.
    """

    manifest: dict[str, Any]
    ids: np.ndarray
    hashes: np.ndarray
    places: np.ndarray
    axes: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    oscillating: np.ndarray
    methods: tuple[str, ...]
    verdict: np.ndarray
    verdict_raw: np.ndarray
    score: np.ndarray
    score_raw: np.ndarray
    applicable: np.ndarray
    failed: np.ndarray
    runtime: np.ndarray

    @classmethod
    def read(cls, path: str | Path) -> Book:
        """Read a finished run.

        Parameters
        ----------
        path : str or Path
            Its folder.

        Returns
        -------
        Book

        Raises
        ------
        RunError
            When there is no finished run of this format version.
        """
        manifest = read_manifest(path)
        for kind in KINDS:
            _table(path, kind)
        check_tables(path, manifest)
        methods = tuple(manifest["methods"])
        scenarios, verdicts = _table(path, "scenarios"), _table(path, "verdicts")
        words = ("block", "member", "process", "controller", "valve", "disturbance", "tuning")
        numbers = tuple(a for a in AXES if a not in words)
        columns = ["scenario_id", "record_hash", "cell", "repeat", *words, *numbers]
        columns += ["sticky", "predicted", "cycled", "oscillating"]
        n, m = pq.read_metadata(scenarios).num_rows, len(methods)
        ids, hashes, cycled = np.empty(n, dtype="S16"), np.empty(n, dtype="S16"), np.empty(n, dtype=object)
        places = np.empty(n, dtype=object)
        axes: dict[str, np.ndarray] = {a: np.empty(n, dtype=object if a in words else float) for a in (*words, *numbers)}
        truth = {t: np.empty(n, dtype=np.int8) for t in ("sticky", "predicted", "cycled")}
        oscillating = np.empty(n, dtype=bool)
        row = 0
        for batch in _batches(scenarios, columns):
            part = slice(row, row := row + batch.num_rows)
            ids[part] = batch.column("scenario_id").to_pylist()
            hashes[part] = [h or "" for h in batch.column("record_hash").to_pylist()]
            for name in words:
                axes[name][part] = _words(batch.column(name))
            for name in numbers:
                axes[name][part] = batch.column(name).to_numpy(zero_copy_only=False)
            for name in ("sticky", "predicted"):
                truth[name][part] = _flags(batch.column(name))
            place = zip(*(batch.column(c).to_pylist() for c in ("cell", "repeat", "member")), strict=True)
            places[part] = ["/".join(map(str, p)) for p in place]
            cycled[part] = _words(batch.column("cycled"))
            oscillating[part] = _flags(batch.column("oscillating")) == 1
        truth["cycled"][:] = np.select([cycled == "yes", cycled == "no"], [1, 0], -1)
        kinds = {"verdict": np.int8, "verdict_raw": np.int8, "score": float, "score_raw": float, "applicable": np.int8}
        out = {name: np.empty((m, n), dtype=kind) for name, kind in kinds.items()}
        failed, runtime = np.empty((m, n), dtype=bool), np.empty((m, n), dtype=np.float32)
        row = 0
        for batch in _batches(verdicts, ["scenario_id", "method", *kinds, "error", "runtime_s"]):
            part = slice(row, row := row + batch.num_rows // max(m, 1))
            _check_order(batch, ids[part], methods, path)
            for name in ("verdict", "verdict_raw"):
                out[name][:, part] = _codes(batch.column(name)).reshape(-1, m).T
            for name in ("score", "score_raw"):
                out[name][:, part] = batch.column(name).to_numpy(zero_copy_only=False).reshape(-1, m).T
            out["applicable"][:, part] = _flags(batch.column("applicable")).reshape(-1, m).T
            failed[:, part] = batch.column("error").is_valid().to_numpy(zero_copy_only=False).reshape(-1, m).T
            runtime[:, part] = batch.column("runtime_s").to_numpy(zero_copy_only=False).reshape(-1, m).T
        truth["cycled_word"] = cycled
        marks = (ids, hashes, places.astype(str))
        return cls(manifest, *marks, axes, truth, oscillating, methods, **out, failed=failed, runtime=runtime)


def seal_file(where: Path, number: int) -> Path:
    """Return where the checksums of a piece stand."""
    return where / PARTS / f"{number:06d}.json"


def part_file(where: Path, number: int, kind: str) -> Path:
    """Return where one table of a piece stands."""
    return where / PARTS / f"{number:06d}.{kind}.parquet"


def _table(path: str | Path, kind: str) -> Path:
    file = Path(path) / f"{kind}.parquet"
    if not file.exists():
        read_manifest(path)
        raise RunError(f"{path} is not finished: {file.name} is missing; continue the run with --resume")
    return file


def _batches(file: Path, columns: list[str]) -> Iterator[pa.Table]:
    # whole row groups: a row group holds whole scenarios
    source = pq.ParquetFile(file)
    for i in range(source.num_row_groups):
        yield source.read_row_group(i, columns=columns)


def _check_order(batch: pa.Table, ids: np.ndarray, methods: Iterable[str], path: str | Path) -> None:
    found = np.array(batch.column("scenario_id").to_pylist(), dtype="S16").reshape(-1, len(tuple(methods)))
    names = batch.column("method").to_pylist()
    if not np.array_equal(found, np.repeat(ids[:, None], found.shape[1], axis=1)) or names != list(methods) * len(found):
        raise RunError(f"{path} is damaged: verdicts and scenarios do not match; run it again")


def _words(column: pa.ChunkedArray) -> np.ndarray:
    coded = column.dictionary_encode().unify_dictionaries().combine_chunks()
    coded = coded.chunk(0) if isinstance(coded, pa.ChunkedArray) else coded
    # objects: all rows share a few strings
    names = np.array([*coded.dictionary.to_pylist(), ""], dtype=object)
    return names[coded.indices.fill_null(len(names) - 1).to_numpy(zero_copy_only=False)]


def _codes(column: pa.ChunkedArray) -> np.ndarray:
    return np.array([CODES[v] for v in column.to_pylist()], dtype=np.int8)


def _flags(column: pa.ChunkedArray) -> np.ndarray:
    return column.cast(pa.int8()).fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int8)

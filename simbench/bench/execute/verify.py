"""Verify a run: resolve its grid again, simulate and judge a random share again, and recompute all
scores.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from simbench.bench.execute.compute_piece import PieceSettings, compute_piece, scenario_columns
from simbench.bench.execute.distribute import on_processes
from simbench.bench.execute.pieces import partition_file, records_hash
from simbench.bench.execute.plugin_host import error_text, settled, truth
from simbench.bench.execute.run import KINDS_OF_PART, about_method
from simbench.bench.execute.verify_result import Notes, Verification
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import BENCHMARK, OF_RUN, SETTLED, benchmark_of, grid_of_run
from simbench.bench.store.checksums import (
    TABLE_KINDS,
    TABLES,
    RunError,
    check_tables,
    file_digest,
    read_verified,
)
from simbench.bench.store.manifest import MANIFEST, describe, read_manifest
from simbench.bench.store.place import Place, place_of
from simbench.bench.store.reading import read_book, read_scenario
from simbench.detectors.errors import UnknownName
from simbench.detectors.plugins.host import SECONDS
from simbench.detectors.plugins.registry import methods as registry
from simbench.files import csv_text, record_text
from simbench.loop.hosted import add_parts, hosted_parts
from simbench.scenarios.grid import Grid, chunks

SHARE = 0.05  # of the scenarios
# scenarios that are simulated again whatever the share: with every method, and with the methods of
# budget "fast"
_LEAST, _LEAST_FAST = 100, 1000
_RUNTIMES = {"runtime_s", "median_ms"}  # columns that may differ
_CHECKED_FILES = {
    MANIFEST,
    "scores.csv",
    "scores_by_axis.csv",
    "records",
    *(f"{kind}.parquet" for kind in TABLE_KINDS),
}


def verify_run(
    folder: str | Path,
    share: float = SHARE,
    jobs: int = 1,
    plugins: Iterable[str | Path] = (),
    seconds: float = SECONDS,
) -> Verification:
    """Simulate a share of a run again and compare everything that it states; the share is drawn
    anew by every call.

    The grid is that of the package where the run names one, else the copy in the manifest. RunError
    for a folder that is damaged, a baseline, or whose loops need plug-ins that are not given.
    """
    if not 0.0 <= share <= 1.0:
        raise RunError(f"share = {share}; a number from 0 to 1 is needed")
    place = place_of(folder)
    manifest = read_manifest(place)
    check_tables(place, manifest)
    if isinstance(manifest[TABLES]["scenarios"], str):
        raise RunError(
            f"{place} is a baseline, which keeps no reasons and no records; the folder of a run is"
            " needed"
        )
    notes, marks = Notes(), manifest[TABLES]
    files = _plugin_files(place, manifest, plugins, notes)
    stages = tuple(tuple(files[kind]) for kind in KINDS_OF_PART)
    with registry.hosted(files[""], seconds), hosted_parts(*stages, seconds=seconds):
        asked, unasked = _methods(manifest, notes)
        try:
            grid, book = grid_of_run(place, manifest), read_book(place)
            origin = _compare_stated(manifest, grid, asked, book, notes)
            _compare_scores(place, book, notes)
            pieces = [range(*piece) for piece in chunks(grid)]
        except (
            RunError,
            LookupError,
            TypeError,
            ValueError,
            AttributeError,
            ArithmeticError,
        ) as error:
            notes.add("the shape of tables and manifest", "", "a run", error_text(error))
            return Verification(str(place), "", 0, contradictions=tuple(notes.sentences()))
        for kind in TABLE_KINDS:
            notes.compare(f"number of files of table {kind}", "", len(marks[kind]), len(pieces))
        fast = [m for m in asked if m != ORACLE and registry.load(m).METHOD.budget == "fast"]
        order = (
            np.random.default_rng()
            .permutation([group for groups in pieces for group in groups])
            .tolist()
        )
        n, held = sum(map(grid.size, order)), np.cumsum([grid.size(group) for group in order])
        least = [max(math.ceil(share * n), min(n, some)) for some in (_LEAST_FAST, _LEAST)]
        wide, deep = (frozenset(order[: int(np.searchsorted(held, some)) + 1]) for some in least)
        settings = PieceSettings(
            tuple(asked),
            tuple(files[""]),
            time_limit=seconds,
            parts=stages,
        )
        task = _Verification(place.absolute(), marks, grid, tuple(fast), (wide, deep), settings)
        with on_processes(jobs) as run:
            for piece_notes in run(task, list(enumerate(pieces))[: min(map(len, marks.values()))]):  # pyright: ignore
                notes.merge(piece_notes)  # pyright: ignore
        _compare_records(place, notes)
    sizes = {m: sum(map(grid.size, wide if m in fast else deep)) for m in asked}
    others = (f"file {name}" for name in sorted(set(place.names()) - _CHECKED_FILES))
    unchecked = (*others, "run times, machine, commit and command")
    return Verification(
        str(place),
        origin,
        n,
        sum(map(grid.size, wide)),
        sizes,
        unchecked,
        tuple(notes.sentences()),
        tuple(unasked),
    )


@dataclass(frozen=True)
class _Verification:
    """What is done with every piece of a run: one file of each table, and the groups that stand in
    it.
    """

    place: Place
    marks: dict[str, list[str]]  # checksums of both tables' files
    grid: Grid
    fast: tuple[str, ...]  # methods of budget "fast"
    # groups simulated again, and those of them that all methods judge again
    sampled: tuple[frozenset[int], frozenset[int]]
    settings: PieceSettings  # with all methods that can be asked

    def __call__(self, number: int, groups: Sequence[int]) -> Notes:
        add_parts(*self.settings.parts, seconds=self.settings.time_limit)
        notes = Notes()
        files = [(partition_file(kind, number), self.marks[kind][number]) for kind in TABLE_KINDS]
        stored_verdicts, stored_scenarios = (
            _rows(read_verified(self.place, *file)) for file in files
        )
        wide, deep = self.sampled
        rows = {
            g: [scenario_columns(s, g) for s, _ in settled(self.grid.group(g))]
            for g in groups
            if g not in wide
        }
        verdicts: list[dict[str, Any]] = []
        quick = replace(self.settings, methods=self.fast)
        for settings, some in ((self.settings, wide & deep), (quick, wide - deep)):
            chosen = [g for g in groups if g in some]
            again = compute_piece(self.grid, number, chosen, settings).tables
            for row in _rows(again["scenarios"]):
                rows.setdefault(row["group"], []).append(row)
            verdicts += _rows(again["verdicts"])
        expected = [row for g in groups for row in rows.get(g, ())]
        ids = [[row["scenario_id"] for row in some] for some in (stored_scenarios, expected)]
        notes.compare("list of scenario ids", f"file {number}", *ids)
        _compare_rows(stored_scenarios, expected, notes)
        _compare_rows(stored_verdicts, verdicts, notes)
        return notes


def _rows(content: bytes) -> list[dict[str, Any]]:
    return pq.ParquetFile(pa.BufferReader(content)).read(use_threads=False).to_pylist()


def _compare_rows(stored: list[dict[str, Any]], again: list[dict[str, Any]], notes: Notes) -> None:
    there = {(row["scenario_id"], row.get("method", "scenario")): row for row in stored}
    for row in again:
        key = row["scenario_id"], row.get("method", "scenario")
        if key not in there:
            notes.add(f"{key[1]}: row", key[0], "none", "one")
        for column in row.keys() - _RUNTIMES if key in there else ():
            notes.compare(f"{key[1]}: {column}", key[0], there[key].get(column), row[column])


def _plugin_files(
    place: Place, manifest: Mapping[str, Any], plugins: Iterable[str | Path], notes: Notes
) -> dict[str, list[str]]:
    """Return the files given by kind of plug-in ("" for detectors), detectors of another digest
    left out.
    """
    stated, files = manifest["plugins"], {kind: [] for kind in ("", *KINDS_OF_PART)}
    given = {f"{kind}{Path(p).stem}": (kind, Path(p).resolve()) for kind in files for p in plugins}
    for file in plugins:
        if not any(f"{kind}{Path(file).stem}" in stated for kind in files):
            raise RunError(
                f"{place} states no plug-in {Path(file).stem!r}; it states:"
                f" {', '.join(stated) or 'none'}"
            )
    for name, digest in stated.items():
        kind, file = given.get(name, ("", None))
        if file is None and name.startswith(KINDS_OF_PART):
            raise RunError(
                f"the loops of {place} need the plug-in {name!r}; its file is needed with --plugin"
            )
        if file is not None:
            notes.compare(f"digest of plug-in {name}", "", digest, file_digest(file))
            # without its part no loop can be simulated, so that a part takes part all the same
            files[kind] += [str(file)] * (
                digest == file_digest(file) or name.startswith(KINDS_OF_PART)
            )
    return files


def _methods(manifest: Mapping[str, Any], notes: Notes) -> tuple[list[str], list[str]]:
    """Return the methods that can be asked again, and the plug-ins whose files are not given."""
    asked, unasked = [], []
    for name in manifest["methods"]:
        try:
            if name != ORACLE:
                registry.load(name)
            asked.append(name)
        except UnknownName:
            unasked.append(name)
            if not {name, f"own {name}"} & set(manifest["plugins"]):
                notes.add(
                    f"method {name}",
                    "",
                    "a method",
                    "neither built in nor a plug-in that the run states",
                )
    return asked, unasked


def _compare_stated(
    manifest: Mapping[str, Any], grid: Grid, asked: Sequence[str], book: Any, notes: Notes
) -> str:
    """Compare what the manifest states with what its grid, this installation and its tables give;
    return the benchmark.
    """
    benchmark, installed = benchmark_of(grid, book.table), describe({})
    counts = {
        "scenarios": book.ids.size,
        "verdicts": book.verdict.size,
        "errors": int(book.failed.sum()),
    }
    again = {
        "grid_hash": grid.hash,
        "seed": grid.content.seed,
        "scenarios": len(grid),
        "counts": counts,
        "records_hash": records_hash(book),
        BENCHMARK: benchmark,
        **{key: installed[key] for key in ("format", "code", "versions")},
    }
    for key, value in again.items():
        notes.compare(f"manifest: {key}", "", manifest.get(key), value)
    for name in asked:
        notes.compare(f"manifest: method {name}", "", manifest["methods"][name], about_method(name))
    of_package = grid.of_package and manifest.get(SETTLED) != OF_RUN
    source = "of the package" if of_package else "as the run keeps it"
    return f"benchmark {benchmark['name']} ({benchmark['hash']}), grid {source} ({grid.hash})"


def _compare_scores(place: Place, book: Any, notes: Notes) -> None:
    """Compare the score files in the folder with the scores of its tables."""
    scores = score_book(book)
    for name, frame in (("scores.csv", scores.table), ("scores_by_axis.csv", scores.by_axis)):
        if name in place.names():
            texts = (place.read(name).decode(), csv_text(frame, float_format="%.5g"))
            stated, again = (
                pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False) for text in texts
            )
            stated, again = (
                table.drop(columns=_RUNTIMES, errors="ignore") for table in (stated, again)
            )
            if not stated.equals(again):
                notes.add(name, "", "other scores", "what the tables give")


def _compare_records(place: Place, notes: Notes) -> None:
    """Simulate the records again that the run kept."""
    for name in place.names("records"):
        try:
            scenario = read_scenario(str(place), name.removesuffix(".csv"))
        except RunError as error:
            notes.add("a record that was kept", name, "of this run", str(error))
            continue
        again = record_text(truth(scenario.loop, scenario.seed)[0].record)
        notes.compare("a record that was kept", name, place.read(f"records/{name}").decode(), again)

"""Verification of a run: its grid is resolved again, a random share simulated and judged again, and all scores recomputed."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from detectors.errors import UnknownName
from detectors.plugins.host import SECONDS
from detectors.plugins.registry import methods as registry
from scenarios.grid import Grid, chunks, grid_names, load_grid
from simbench.bench.execute import adaptive
from simbench.bench.execute.pieces import Receipt, partition_file, records_hash
from simbench.bench.execute.plugin_host import said_of, settled, truth
from simbench.bench.execute.run import about_method
from simbench.bench.execute.work import scenario_columns, work
from simbench.bench.execute.workers import on_processes
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.baseline import read_book
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import BENCHMARK, benchmark_of, grid_of
from simbench.bench.store.checksums import TABLE_KINDS, TABLES, RunError, check_tables, file_digest, verified
from simbench.bench.store.manifest import MANIFEST, describe, read_manifest
from simbench.bench.store.place import Place, place_of
from simbench.bench.store.reading import read_scenario
from simbench.bench.store.tables import SCENARIOS, VERDICT_SCHEMA
from simbench.files import csv_text, record_text
from simbench.loop.hosted import add_parts, hosted_parts

SHARE = 0.05  # of the scenarios
# scenarios that are simulated again whatever the share: with every method, and with the methods of budget "fast"
_LEAST, _LEAST_FAST = 100, 1000
_SURE = 0.95  # probability with which a change of the stated size is detected
_RUNTIMES = {"runtime_s", "median_ms"}  # columns that may differ
_PARTS = ("valve ", "effect ", "plant ", "controller ")  # before the names of plug-ins of loops, in a manifest
_SCHEMAS = {"scenarios": SCENARIOS, "verdicts": VERDICT_SCHEMA}
_CHECKED_FILES = {MANIFEST, "scores.csv", "scores_by_axis.csv", "records", *(f"{kind}.parquet" for kind in TABLE_KINDS)}


@dataclass(frozen=True)
class Verification:
    """What a verification compared, and what contradicted the run."""

    folder: str
    stated: dict[str, Any]  # the run's benchmark
    scenarios: int  # of the run
    simulated: int = 0  # how many of them were simulated again
    asked: dict[str, int] = field(default_factory=dict)  # on how many records each method was asked again
    unchecked: tuple[str, ...] = ()  # what was not checked
    contradictions: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Return one sentence where nothing contradicts the run, else every contradiction."""
        if self.contradictions:
            return "\n".join([f"{self.folder} is refuted:", *(f"- {c}" for c in self.contradictions)])
        groups: dict[int, list[str]] = {}
        for method, n in self.asked.items():
            groups.setdefault(n, []).append(method)
        asked = "; ".join(f"{', '.join(some)} on {n}{_escape(n, self.scenarios)}" for n, some in sorted(groups.items()))
        return (
            f"{self.folder} is verified as a run of benchmark {self.stated['name']} ({self.stated['hash']}): the "
            f"definitions of all {self.scenarios} scenarios and every score were computed again, {self.simulated} scenarios "
            f"were simulated again, and methods were asked again: {asked or 'none'}. "
            f"Not checked: {', '.join(self.unchecked)}."
        )

    def as_json(self) -> dict[str, Any]:
        """Return the same as JSON types."""
        numbers = {"scenarios": self.scenarios, "simulated": self.simulated, "asked": self.asked}
        lists = {"unchecked": list(self.unchecked), "contradictions": list(self.contradictions)}
        return {"verified": not self.contradictions, BENCHMARK: self.stated, **numbers, **lists, "text": self.as_text()}


def verify_run(
    folder: str | Path, share: float = SHARE, jobs: int = 1, plugins: Iterable[str | Path] = (), seconds: float = SECONDS
) -> Verification:
    """Simulate a share of a run again and compare everything that it states; the share is drawn anew by every call.

    The grid is that of the package where the run names one, else the copy in the manifest. RunError for a folder that is
    damaged, a baseline, or whose loops need plug-ins that are not given.
    """
    place = place_of(folder)
    manifest = read_manifest(place)
    check_tables(place, manifest)
    if "grid_content" not in manifest:
        raise RunError(f"{place} keeps no grid, as baselines do; the folder of a run is needed")
    files, mismatched = _plugin_files(place, manifest, plugins)
    stated = manifest.get(BENCHMARK) or {"name": "none", "hash": "none"}
    if mismatched:
        return Verification(str(place), stated, 0, contradictions=tuple(mismatched))
    notes = _Notes()
    stages = tuple(tuple(files.get(kind, ())) for kind in _PARTS)
    with registry.hosted(files.get("", ()), seconds) as added, hosted_parts(*stages, seconds=seconds):
        asked, unasked = _methods(manifest, added, notes)
        try:
            grid = grid_of(manifest)
            book = read_book(place)
            _compare_stated(manifest, grid, asked, book, notes)
            _compare_scores(place, book, notes)
            pieces = list(_pieces(place, manifest, grid))
        except (RunError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            notes.add("the shape of tables and manifest", "", "a run", said_of(error))
            return Verification(str(place), stated, 0, contradictions=tuple(notes.sentences()))
        if len(pieces) != len(manifest[TABLES]["scenarios"]):
            notes.add("number of table files", "", len(manifest[TABLES]["scenarios"]), len(pieces))
        n = sum(grid.size(group) for groups in pieces for group in groups)
        fast = [m for m in asked if m != ORACLE and registry.load(m).METHOD.budget == "fast"]
        order = np.random.default_rng().permutation([group for groups in pieces for group in groups])
        held = np.cumsum([grid.size(int(group)) for group in order])
        deep, wide = (
            {int(g) for g in order[: np.searchsorted(held, max(math.ceil(share * n), min(n, least))) + 1]}
            for least in (_LEAST, _LEAST_FAST)
        )
        settings = {"plugins": files.get("", ()), "thresholds": manifest["thresholds"], "seconds": seconds, "stages": stages}
        ask = {**settings, "front_end": manifest["front_end"]}
        task = _Task(place.absolute(), manifest, grid, (tuple(fast), tuple(asked)), (frozenset(wide), frozenset(deep)), ask)
        with on_processes(jobs) as run:
            for found in run(task, list(enumerate(pieces))[: len(manifest[TABLES]["scenarios"])]):  # pyright: ignore
                notes.merge(found)  # pyright: ignore
        _compare_records(place, notes)
    sizes = {m: sum(grid.size(g) for g in (wide if m in fast else deep)) for m in asked}
    other = sorted(set(place.names()) - _CHECKED_FILES)
    unchecked = (*unasked, *(f"file {name}" for name in other), "run times, machine, commit and command")
    simulated = sum(grid.size(g) for g in wide)
    return Verification(str(place), stated, n, simulated, sizes, unchecked, tuple(notes.sentences()))


class _Notes:
    """Contradictions by what they concern, counted, each with its first example."""

    def __init__(self) -> None:
        self.found: dict[str, tuple[int, str, Any, Any]] = {}

    def add(self, what: str, where: str, stated: Any, again: Any) -> None:
        count, *first = self.found.get(what, (0, where, stated, again))
        self.found[what] = (count + 1, *first)

    def compare(self, what: str, where: str, stated: Any, again: Any) -> None:
        if stated != again:
            self.add(what, where, stated, again)

    def merge(self, other: _Notes) -> None:
        for what, (count, *first) in other.found.items():
            before, *earlier = self.found.get(what, (0, *first))
            self.found[what] = (before + count, *earlier)

    def sentences(self) -> Iterator[str]:
        for what, (count, where, stated, again) in self.found.items():
            times = f" {count} times, first in {where}" if where else ""
            yield f"{what} differs{times}: the run states {str(stated)[:200]}, computed again it is {str(again)[:200]}"


@dataclass(frozen=True)
class _Task:
    """What is done with every piece of a run: one file of each table, and the groups that stand in it."""

    place: Place
    manifest: dict[str, Any]
    grid: Grid
    methods: tuple[tuple[str, ...], tuple[str, ...]]  # of budget "fast", and all that can be asked
    sampled: tuple[frozenset[int], frozenset[int]]  # groups simulated again, and those of them that all methods judge again
    settings: dict[str, Any]  # how `work` asks

    def __call__(self, number: int, groups: Sequence[int]) -> _Notes:
        add_parts(*self.settings["stages"], seconds=self.settings["seconds"])
        notes = _Notes()
        stored = {kind: self._stored(kind, number, notes) for kind in TABLE_KINDS}
        (fast, every), (wide, deep) = self.methods, self.sampled
        rows = {g: [scenario_columns(s, g) for s, _ in settled(self.grid.group(g))] for g in groups if g not in wide}
        verdicts: list[dict[str, Any]] = []
        for methods, some in ((every, wide & deep), (fast, wide - deep)):
            chosen = [g for g in groups if g in some]
            chunk = work(self.grid, number, chosen, methods, **self.settings)
            for row in _table(chunk.scenarios).to_pylist():
                rows.setdefault(row["group"], []).append(row)
            verdicts += _table(chunk.verdicts).to_pylist()
        expected = [row for g in groups for row in rows.get(g, ())]
        ids = [[row["scenario_id"] for row in some] for some in (stored["scenarios"], expected)]
        notes.compare("list of scenario ids", f"file {number}", *ids)
        _compare_rows("scenario", stored["scenarios"], expected, lambda row: (row["scenario_id"],), notes)
        _compare_rows("verdict", stored["verdicts"], verdicts, lambda row: (row["scenario_id"], row["method"]), notes)
        return notes

    def _stored(self, kind: str, number: int, notes: _Notes) -> list[dict[str, Any]]:
        content = verified(self.place, partition_file(kind, number), self.manifest[TABLES][kind][number])
        table = _table(content)
        notes.compare(f"columns of table {kind}", f"file {number}", table.schema.names, _SCHEMAS[kind].names)
        return table.to_pylist()


def _table(content: bytes) -> pa.Table:
    return pq.ParquetFile(pa.BufferReader(content)).read(use_threads=False)


def _compare_rows(kind: str, stored: list[dict], again: list[dict], key: Callable[[dict], tuple], notes: _Notes) -> None:
    there = {key(row): row for row in stored}
    if len(there) < len(stored):
        notes.add(f"{kind} rows", key(stored[0])[0], f"{len(stored)} rows", f"{len(there)} of them different")
    for row in again:
        was, name = there.get(key(row)), row.get("method", "scenario")
        if was is None:
            notes.add(f"{name}: {kind}", row["scenario_id"], "no row", "a row")
            continue
        for column in row.keys() - _RUNTIMES:
            notes.compare(f"{name}: {column}", row["scenario_id"], was.get(column), row[column])


def _plugin_files(
    place: Place, manifest: Mapping[str, Any], plugins: Iterable[str | Path]
) -> tuple[dict[str, list[str]], list[str]]:
    """Return the files given by kind of plug-in ("" for detectors), and what contradicts the digests that the run states."""
    stated, files, wrong = manifest["plugins"], {}, []
    for file in (Path(p).resolve() for p in plugins):
        kind = next((kind for kind in ("", *_PARTS) if f"{kind}{file.stem}" in stated), None)
        if kind is None:
            raise RunError(f"{place} states no plug-in {file.stem!r}; it states: {', '.join(stated) or 'none'}")
        files.setdefault(kind, []).append(str(file))
        if (found := file_digest(file)) != stated[f"{kind}{file.stem}"]:
            wrong.append(f"plug-in {file}: the run states digest {stated[f'{kind}{file.stem}']}, the file given has {found}")
    for name in stated:
        kind = next((kind for kind in _PARTS if name.startswith(kind)), None)
        if kind and name.removeprefix(kind) not in [Path(f).stem for f in files.get(kind, ())]:
            raise RunError(f"the loops of {place} need the plug-in {name!r}; its file is needed with --plugin")
    return files, wrong


def _methods(manifest: Mapping[str, Any], added: Sequence[str], notes: _Notes) -> tuple[list[str], list[str]]:
    """Return the methods that can be asked again, and a phrase about each that cannot."""
    asked, unasked = [], []
    for name in manifest["methods"]:
        try:
            if name != ORACLE:
                registry.load(name)
            asked.append(name)
            continue
        except UnknownName:
            pass
        if name in manifest["plugins"] or f"own {name}" in manifest["plugins"]:
            unasked.append(f"method {name} (plug-in without its file)")
        else:
            notes.add(f"method {name}", "", "a method", "neither built in nor a plug-in that the run states")
    notes.compare("plug-ins among the methods", "", sorted(set(added) - set(asked)), [])
    return asked, unasked


def _compare_stated(manifest: Mapping[str, Any], grid: Grid, asked: Sequence[str], book: Any, notes: _Notes) -> None:
    """Compare what the manifest states with what its grid, this installation and its tables give."""
    counts = {"scenarios": book.ids.size, "verdicts": book.verdict.size, "errors": int(book.failed.sum())}
    again = {
        "grid_hash": grid.hash, "cells_hash": grid.cells_hash, "seed": grid.content.seed, "scenarios": len(grid),
        "counts": counts, "records_hash": records_hash(book), BENCHMARK: benchmark_of(grid, book.ids.astype(str).tolist()),
        **{key: describe({})[key] for key in ("format", "code", "versions")},
    }  # fmt: skip
    for key, value in again.items():
        notes.compare(f"{key} in the manifest", "", manifest.get(key), value)
    if grid.name in grid_names():
        published = load_grid(grid.name)
        same = {"seed": grid.content.seed, "repeats": grid.content.repeats}
        if published.cells_hash == grid.cells_hash and published.content.model_copy(update=same) != grid.content:
            notes.add(f"text of grid {grid.name}", "", "another title, source or version", "that of the package")
    for name in asked:
        notes.compare(f"what the manifest states of method {name}", "", manifest["methods"][name], about_method(name))
    notes.compare("thresholds of methods that the run has not", "", sorted(set(manifest["thresholds"]) - set(book.methods)), [])


def _compare_scores(place: Place, book: Any, notes: _Notes) -> None:
    """Compare the score files in the folder with the scores of its tables."""
    scores = score_book(book)
    for name, frame in (("scores.csv", scores.table), ("scores_by_axis.csv", scores.by_axis)):
        if name in place.names():
            texts = (place.read(name).decode(), csv_text(frame, float_format="%.5g"))
            stated, again = (pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False) for text in texts)
            columns = [column for column in again if column not in _RUNTIMES]
            notes.compare(f"columns of {name}", "", list(stated), list(again))
            same = set(columns) <= set(stated) and stated[columns].equals(again[columns])
            notes.compare(name, "", "other scores" if not same else "", "")


def _pieces(place: Place, manifest: Mapping[str, Any], grid: Grid) -> Iterator[Sequence[int]]:
    """Yield the groups of every piece of a run, with the rounds that `until_width` adds, from the grid alone."""
    groups: list[Sequence[int]] = [range(*piece) for piece in chunks(grid)]
    marks, done = manifest[TABLES], 0
    while groups:
        yield from groups
        done += len(groups)
        if (width := manifest["until_width"]) is None or done > len(marks["scenarios"]):
            return
        receipts = [Receipt(i, 0, 0, 0, 0, 0, {kind: marks[kind][i] for kind in TABLE_KINDS}) for i in range(done)]
        groups = list(adaptive.next_round(grid, place, receipts, width, list(manifest["methods"]), {}))


def _compare_records(place: Place, notes: _Notes) -> None:
    """Simulate the records again that the run kept."""
    for name in place.names("records"):
        scenario = read_scenario(str(place), name.removesuffix(".csv"))
        again = record_text(truth(scenario.loop, scenario.seed)[0].record)
        notes.compare("a record that was kept", name, place.read(f"records/{name}").decode(), again)


def _escape(asked: int, scenarios: int) -> str:
    if asked >= scenarios:
        return " (all)"
    least = math.ceil(math.log(1 - _SURE) / math.log1p(-asked / scenarios))
    return f" (fewer than {least} changed verdicts of a method can escape with a probability above {1 - _SURE:.0%})"

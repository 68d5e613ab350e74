"""Run a grid: pieces in parallel, each on disk as soon as it is whole, so that nothing finished is
ever lost.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import pickle
import secrets
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import cloudpickle

from detectors.errors import UserError, masked, nearest
from detectors.judge import check_thresholds, known_front_end, refuse_wrong_forms
from detectors.plugins.host import SECONDS
from detectors.plugins.registry import methods as registry
from detectors.report.report import choose_methods
from detectors.sources import as_plugin
from scenarios.grid import Grid, chunks, load_grid
from scenarios.sample import Sample
from simbench.bench.execute import adaptive, pieces
from simbench.bench.execute.grid_check import refuse_too_large, refuse_wrong_parts, size_of
from simbench.bench.execute.pieces import Receipt
from simbench.bench.execute.work import Thresholds, work
from simbench.bench.execute.workers import Runner, on_cluster, on_processes, on_ray
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.store.checksums import RunError, check_tables, file_digest
from simbench.bench.store.manifest import describe, read_manifest, run_key
from simbench.bench.store.place import Place, place_of
from simbench.loop.hosted import hosted_parts

_BACKENDS = ("loky", "dask", "ray")
LIVES = 3  # how often dead workers are replaced before the run gives up


class Interrupted(KeyboardInterrupt):
    """A run stopped by Ctrl-C or SIGTERM; its text says how to resume."""


def run_grid(
    grid: str | Path | Grid,
    out: str | Path | None = None,
    methods: Iterable[str] = ("fast",),
    jobs: int = 1,
    *,
    raw: bool = False,
    front_end: str = "acf",
    plugins: Iterable[str | Path] = (),
    backend: str = "loky",
    address: str | None = None,
    resume: bool = False,
    until_width: float | None = None,
    sets: Mapping[str, Any] | None = None,
    axes: Mapping[str, Sequence[Any]] | None = None,
    thresholds: Thresholds | None = None,
    keep: int = 0,
    progress: bool | None = None,
    large: bool = False,
    time_limit: float = SECONDS,
    valve_plugins: Iterable[str | Path] = (),
    effect_plugins: Iterable[str | Path] = (),
    plant_plugins: Iterable[str | Path] = (),
    controller_plugins: Iterable[str | Path] = (),
    fresh_seeds: bool = False,
    own: Mapping[str, Any] | None = None,
) -> Path:
    """Simulate a grid, judge it by detectors, and write both tables."""
    began = time.perf_counter()
    if backend not in _BACKENDS:
        raise RunError(f"unknown backend {backend!r}: {nearest(backend, _BACKENDS)}")
    if until_width is not None and not adaptive.NARROWEST <= until_width < 1:
        raise RunError(
            f"until_width = {until_width}; a number between {adaptive.NARROWEST} and 1 is needed"
        )
    parts = (valve_plugins, effect_plugins, plant_plugins, controller_plugins)
    stages = tuple(tuple(str(Path(p).resolve()) for p in some) for some in parts)
    if fresh_seeds and (resume or isinstance(grid, Grid) or "seed" in (sets or {})):
        raise RunError(
            "--fresh-seeds draws the grid's seed: it needs a grid by name or file, and neither"
            " --resume nor --set seed= (to resume such a run, give --resume and --set seed= with"
            " the seed that its manifest states)"
        )
    drawn = {"seed": secrets.randbits(62)} if fresh_seeds else {}
    plan = grid if isinstance(grid, Grid) else load_grid(grid, {**(sets or {}), **drawn}, axes)
    files = [str(Path(p).resolve()) for p in plugins]
    callers = own or {}
    # read before any plug-in runs, as one may move its own file
    digests = _digests(("", files), *zip(("valve ", "effect ", "plant ", "controller "), stages))
    adopted = registry.adopted(
        {name: as_plugin(name, detector) for name, detector in callers.items()}
    )
    with (
        adopted,
        registry.hosted(files, time_limit) as added,
        hosted_parts(*stages, seconds=time_limit),
    ):
        asked = [part.strip() for text in methods for part in text.split(",")]
        names = choose_methods(m for m in asked if m != ORACLE)
        names += [a for a in added if a not in names]
        names += [ORACLE] * (ORACLE in asked)  # last, as it is judged last
        refuse_wrong_forms(names)
        _check_settings(names, thresholds or {})
        refuse_too_large(size_of(plan, *_budgets(names)), plan.name, large)
        refuse_wrong_parts(plan)
        manifest = describe(
            {
                "grid": plan.name,
                "grid_hash": plan.hash,
                "cells_hash": plan.cells_hash,
                "grid_content": plan.content.model_dump(mode="json"),
                "overrides": plan.overrides,
                "seed": plan.content.seed,
                "scenarios": len(plan),
                "methods": {n: about_method(n) for n in names},
                "thresholds": {k: dict(v) for k, v in (thresholds or {}).items()},
                "plugins": (
                    digests
                    | {
                        f"own {name}": _source_digest(detector)
                        for name, detector in callers.items()
                    }
                ),
                "until_width": until_width,
                "raw": raw,
                "front_end": known_front_end(front_end),
                "command": masked(" ".join(sys.argv)),
                **({"points": plan.points} if isinstance(plan, Sample) else {}),
            }
        )
        chosen = {k: dict(v) for k, v in (thresholds or {}).items()}
        settings = (
            tuple(names),
            tuple(files),
            chosen,
            keep,
            time_limit,
            stages,
            front_end,
            callers,
        )
        where = Path("runs") / plan.name if out is None else out
        place = place_of(where)
        place.refuse_unkept()
        with _workers(backend, address, jobs) as run, pieces.held(place):
            pieces.open_run(place, manifest, resume)
            if pieces.is_finished(place):
                check_tables(place, read_manifest(place))
                return _path(place)
            task = _Task(plan, place, run_key(manifest), settings)
            with _Bar(progress, len(plan)) as bar, _stoppable():
                try:
                    receipts = _all_pieces(plan, place, task, run, bar, until_width, names)
                    times = bar.times(time.perf_counter() - began)
                    pieces.finish(place, receipts, {**manifest, "times": times, **bar.extra})
                except KeyboardInterrupt:
                    raise Interrupted(f"interrupted: {pieces.standing(place)}") from None
                except UserError as error:
                    raise RunError(f"{error}; {pieces.standing(place)}") from error
        return _path(place)


def _workers(backend: str, address: str | None, jobs: int) -> AbstractContextManager[Runner]:
    if backend == "loky":
        return on_processes(jobs)
    return on_cluster(address) if backend == "dask" else on_ray(address, jobs)


def _path(place: Place) -> Path:
    # a URL is no path, but stands wherever a run's folder is asked for
    return cast(Path, place.url) if place.local is None else place.local


class _Task:
    """What every piece has in common; where it is called, the piece is worked and written."""

    def __init__(self, grid: Grid, place: Place, key: str, settings: tuple) -> None:
        # packed once, not for every piece; a worker may stand in another folder
        # by value: a caller's own detector may stand in a notebook
        self._packed = cloudpickle.dumps((grid, place.absolute(), key, settings))

    def __call__(self, number: int, groups: Sequence[int]) -> Receipt:
        grid, place, key, settings = _unpacked(self._packed)
        there = pieces.find_receipt(place, number, key)
        return there or pieces.write_piece(place, work(grid, number, groups, *settings), key)


@lru_cache(maxsize=2)
def _unpacked(packed: bytes) -> tuple:
    return pickle.loads(packed)


def _all_pieces(
    plan: Grid,
    place: Place,
    task: _Task,
    run: Runner,
    bar: _Bar,
    width: float | None,
    methods: Sequence[str],
) -> list[Receipt]:
    """Work through the grid, then, where an accuracy is asked for, round by round through what it
    lacks.
    """
    groups: Sequence[Sequence[int]] = [range(*piece) for piece in chunks(plan)]
    receipts: list[Receipt] = []
    while groups:
        receipts += _worked(place, task, run, bar, dict(enumerate(groups, len(receipts))))
        groups = (
            []
            if width is None
            else adaptive.next_round(plan, place, receipts, width, methods, bar.extra)
        )
        bar.more(sum(plan.size(i) for some in groups for i in some))
    return receipts


def _worked(
    place: Place, task: _Task, run: Runner, bar: _Bar, missing: dict[int, Sequence[int]]
) -> list[Receipt]:
    """Return the receipts of some pieces, in order; what a dead worker held is worked again."""
    lives, receipts = LIVES, {}
    while missing:
        try:
            for receipt in run(task, list(missing.items())):
                receipts[receipt.piece] = receipt
                bar.add(receipt)
        except Exception as error:
            if not _worker_died(error):
                raise
            lives -= 1
            if lives == 0:
                raise RunError(
                    f"worker processes keep dying ({error}); fewer jobs may leave each more memory"
                ) from None
        missing = {number: groups for number, groups in missing.items() if number not in receipts}
    return [receipts[number] for number in sorted(receipts)]


def _worker_died(error: Exception) -> bool:
    # loky, dask and ray name it differently, and none need be installed
    names = {"BrokenProcessPool", "TerminatedWorkerError", "KilledWorker", "WorkerCrashedError"}
    return any(c.__name__ in names for c in type(error).__mro__)


@contextlib.contextmanager
def _stoppable() -> Iterator[None]:
    """Let SIGTERM end a run like Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # not by way of SIGINT: a shell starts its background jobs with that one ignored
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class _Bar:
    """Progress on stderr, and the sums that end in the manifest."""

    def __init__(self, shown: bool | None, total: int) -> None:
        from simbench.progress import Progress

        self._bar = Progress(
            total=total, unit=" scenarios", desc="run", bar=bool(shown), disable=shown is False
        )
        self._failures = 0
        self._seconds = {"simulating": 0.0, "judging": 0.0, "working": 0.0}
        self.extra: dict[str, Any] = {}

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def add(self, receipt: Receipt) -> None:
        self._failures += receipt.failures
        for name in self._seconds:
            self._seconds[name] += getattr(receipt, name)
        self._bar.set_postfix(failures=self._failures, refresh=False)
        if receipt.found:
            self._skip(receipt.scenarios)
        else:
            self._bar.update(receipt.scenarios)

    def more(self, scenarios: int) -> None:
        if not self._bar.disable:
            self._bar.total = (self._bar.total or 0) + scenarios

    def _skip(self, scenarios: int) -> None:
        """Count what is on disk already as done, without letting it flatter the rate."""
        if self._bar.disable:  # then it lacks even these fields
            return
        self._bar.initial += scenarios
        self._bar.n += scenarios
        self._bar.refresh()

    def times(self, wall: float) -> dict[str, float]:
        return {**{k: round(v, 3) for k, v in self._seconds.items()}, "wall": round(wall, 3)}


def _check_settings(names: Sequence[str], thresholds: Thresholds) -> None:
    for method, values in thresholds.items():
        if method not in names:
            raise RunError(
                f"thresholds are given for {method!r}, which is not among the methods; known:"
                f" {', '.join(names)}"
            )
        check_thresholds(method, registry.load(method).METHOD, values)


def _digests(*kinds: tuple[str, Iterable[str]]) -> dict[str, str]:
    """Return each file's digest; one that is not there is refused by name when it is hosted."""
    return {
        f"{kind}{Path(f).stem}": file_digest(Path(f))
        for kind, files in kinds
        for f in files
        if Path(f).is_file()
    }


def _source_digest(detector: Any) -> str:
    """Return what tells a caller's own detector from another of its name: its source, and its
    parameters where it says them.
    """
    said = (
        detector.get_params(deep=False)
        if hasattr(detector, "get_params")
        else getattr(detector, "__dict__", {})
    )
    try:
        source = inspect.getsource(detector if inspect.isfunction(detector) else type(detector))
    except (OSError, TypeError):  # typed into a shell
        source = repr(getattr(getattr(detector, "__code__", None), "co_code", detector))
    return hashlib.sha256(f"{source}{said}".encode()).hexdigest()


def _budgets(names: Sequence[str]) -> tuple[int, int]:
    slow = sum(n != ORACLE and registry.load(n).METHOD.budget == "full" for n in names)
    return len(names) - slow, slow


def about_method(name: str) -> dict[str, Any]:
    """Return what a run's manifest keeps of a method."""
    if name == ORACLE:
        return {
            "front_end": False,
            "needs_mv": False,
            "role": ORACLE,
            "budget": "full",
            "fitted_on": [],
            "stated": [],
        }
    method = registry.load(name).METHOD
    kept = ("front_end", "needs_mv", "role", "budget")
    lists = {name: list(getattr(method, name)) for name in ("fitted_on", "stated")}
    return {**{name: getattr(method, name) for name in kept}, **lists}

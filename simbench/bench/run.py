"""Run a grid: pieces in parallel, each on disk as soon as it is whole, so that nothing finished is ever lost."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from detectors.errors import UserError, nearest
from detectors.guest import SECONDS
from detectors.judge import check_thresholds, known_front_end
from detectors.registry import methods as registry
from detectors.report import choose_methods
from scenarios.grid import Grid, chunks, load_grid
from simbench.bench import adaptive, store
from simbench.bench.checksums import RunError, check_tables, file_digest
from simbench.bench.grid_check import refuse_too_large, refuse_wrong_parts, size_of
from simbench.bench.manifest import describe, read_manifest, run_key
from simbench.bench.oracle import ORACLE
from simbench.bench.work import Piece, Thresholds, add_parts, work

BACKENDS = ("loky", "dask")
LIVES = 3  # how often dead workers are replaced before the run gives up
PATIENCE = 10  # s, for a dask scheduler to answer


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
) -> Path:
    """Simulate a grid, judge it by detectors, and write both tables.

    Parameters
    ----------
    grid : str, Path or Grid
        Name, file, or a grid at hand.
    out : str or Path, optional
        Folder of the run; runs/GRID when absent.
    methods : iterable of str
        Method ids, "all", "fast" or "full"; "oracle" adds what a test that knows plant and load says.
    jobs : int
        Worker processes; -1 = all cores.
    raw : bool
        Note in the manifest that scores without the front end come first; both are always stored.
    front_end : {"acf", "hagglund"}
        What says whether a loop oscillates, see `detectors.judge.judge`.
    plugins : iterable of str or Path
        Detector files outside the package; they are run as well.
    backend : {"loky", "dask"}
        Where workers live, through joblib.
    address : str, optional
        Scheduler of dask ("tcp://...").
    resume : bool
        Continue a run that was interrupted.
    until_width : float, optional
        Add seeds to every cell until the interval of every method's accuracy is this narrow.
    sets, axes : mapping, optional
        Overrides, see `scenarios.grid.load_grid`.
    thresholds : mapping, optional
        Other thresholds than the methods' own, by method id.
    keep : int
        Records to write per piece, as records/ID.csv.
    progress : bool, optional
        Show a bar on stderr; when absent, only on a terminal.
    large : bool
        Allow more scenarios than anybody asks for by mistake.
    time_limit : float
        Seconds a plug-in may take for a record.
    valve_plugins, effect_plugins : iterable of str or Path
        Files of further valve models and effects, which the grid names.

    Returns
    -------
    Path
        The folder: manifest.json, verdicts.parquet, scenarios.parquet, scores.csv, scores_by_axis.csv.

    Raises
    ------
    UserError
        For what the user can put right; finished pieces stay on disk.
    Interrupted
        After Ctrl-C or SIGTERM.

    Examples
    --------
    >>> import tempfile
    >>> folder = run_grid("smoke", tempfile.mkdtemp(), ["horch"], sets={"disturbance": "none"})
    >>> sorted(f.name for f in folder.iterdir())
    ['manifest.json', 'scenarios.parquet', 'scores.csv', 'scores_by_axis.csv', 'verdicts.parquet']
    """
    began = time.perf_counter()
    if backend not in BACKENDS:
        raise RunError(f"unknown backend {backend!r}: {nearest(backend, BACKENDS)}")
    if until_width is not None and not 0 < until_width < 1:
        raise RunError(f"until_width = {until_width}; a number between 0 and 1 is needed")
    stages = tuple(tuple(str(Path(p).resolve()) for p in some) for some in (valve_plugins, effect_plugins))
    add_parts(stages)
    plan = grid if isinstance(grid, Grid) else load_grid(grid, sets, axes)
    files = [str(Path(p).resolve()) for p in plugins]
    with registry.guests(files, time_limit) as added:
        asked = [part.strip() for text in methods for part in text.split(",")]
        names = choose_methods(m for m in asked if m != ORACLE)
        names += [a for a in added if a not in names]
        names += [ORACLE] * (ORACLE in asked)  # last, as it is judged last
        _check_settings(names, thresholds or {})
        refuse_too_large(size_of(plan, *_budgets(names)), plan.name, large)
        refuse_wrong_parts(plan)
        manifest = describe(
            {
                "grid": plan.name,
                "grid_hash": plan.hash,
                "grid_content": plan.content.model_dump(mode="json"),
                "overrides": plan.overrides,
                "seed": plan.content.seed,
                "scenarios": len(plan),
                "methods": {n: _about(n) for n in names},
                "thresholds": {k: dict(v) for k, v in (thresholds or {}).items()},
                "plugins": {Path(f).stem: file_digest(Path(f)) for f in (*files, *stages[0], *stages[1])},
                "until_width": until_width,
                "raw": raw,
                "front_end": known_front_end(front_end),
                "command": " ".join(sys.argv),
            }
        )
        chosen = {k: dict(v) for k, v in (thresholds or {}).items()}
        task = _Task(plan, run_key(manifest), tuple(names), tuple(files), chosen, keep, time_limit, stages, front_end)
        with _parallel(backend, address, jobs) as run:
            where = store.open_run(Path("runs") / plan.name if out is None else out, manifest, resume)
            if (written := read_manifest(where))["complete"]:
                check_tables(where, written)
                _tidy(where)
                return where
            with _Bar(progress, len(plan)) as bar, _stoppable():
                try:
                    done = _all_pieces(plan, where, task, run, bar, until_width, names)
                    store.finish(where, done, {**manifest, "times": bar.times(time.perf_counter() - began), **bar.extra})
                except KeyboardInterrupt:
                    raise Interrupted(f"interrupted: {_standing(where)}") from None
                except UserError as error:
                    raise RunError(f"{error}; {_standing(where)}") from error
        from simbench.bench.score import score_run

        score_run(where).write(where)
        return where


class _Task:
    """What every piece has in common."""

    def __init__(self, grid: Grid, key: str, *settings: Any) -> None:
        self.grid, self.key, self.settings = grid, key, settings

    def __call__(self, number: int, groups: Sequence[int]) -> Piece:
        return work(self.grid, number, groups, *self.settings)


Runner = Callable[[_Task, list[tuple[int, Sequence[int]]]], Iterator[Piece]]


def _all_pieces(
    plan: Grid, where: Path, task: _Task, run: Runner, bar: _Bar, width: float | None, methods: Sequence[str]
) -> int:
    """Work through the grid, then, where an accuracy is asked for, round by round through what it lacks."""
    pieces = [range(*piece) for piece in chunks(plan)]
    number = 0
    while pieces:
        _missing_pieces(where, task, run, bar, list(enumerate(pieces, number)))
        number += len(pieces)
        pieces = [] if width is None else adaptive.next_round(plan, where, number, width, methods, bar.extra)
        bar.more(sum(plan.size(i) for groups in pieces for i in groups))
    return number


def _missing_pieces(where: Path, task: _Task, run: Runner, bar: _Bar, pieces: list[tuple[int, Sequence[int]]]) -> None:
    lives = LIVES
    missing = [(number, groups) for number, groups in pieces if not store.is_whole(where, number, task.key)]
    bar.skip(_scenarios(task.grid, pieces) - _scenarios(task.grid, missing))
    while missing:
        try:
            for piece in run(task, missing):
                store.write_piece(where, piece, task.key)
                bar.add(piece)
        except Exception as error:
            if not _worker_died(error):
                raise
            lives -= 1
            if lives == 0:
                raise RunError(f"worker processes keep dying ({error}); fewer jobs may leave each more memory") from None
        before, missing = len(missing), [p for p in missing if not store.is_whole(where, p[0], task.key)]
        if len(missing) == before and lives == LIVES:
            raise RunError(f"{where}: what is written there reads back otherwise; is the disk sound?")


def _scenarios(grid: Grid, pieces: Iterable[tuple[int, Sequence[int]]]) -> int:
    return sum(grid.size(i) for _, groups in pieces for i in groups)


def _worker_died(error: Exception) -> bool:
    # loky and dask name it differently, and neither need be installed
    return any(c.__name__ in ("BrokenProcessPool", "TerminatedWorkerError", "KilledWorker") for c in type(error).__mro__)


@contextlib.contextmanager
def _parallel(backend: str, address: str | None, jobs: int) -> Iterator[Runner]:
    """Yield a function that works through pieces in parallel and gives each back when it is done."""
    import joblib

    def parallel(task: _Task, pieces: list[tuple[int, Sequence[int]]]) -> Iterator[Piece]:
        pool: Any = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1, max_nbytes=None)
        # a generator: pieces come back as they get ready
        yield from pool(joblib.delayed(task)(number, groups) for number, groups in pieces)

    with contextlib.ExitStack() as stack:
        settings: dict[str, Any] = {}
        if backend == "dask":
            settings["client"] = stack.enter_context(_dask_client(address))
            jobs = -1
        elif jobs != 1:
            settings.update(inner_max_num_threads=1, initializer=_ignore_interrupt)
        if jobs == 1 and backend == "loky":
            yield lambda task, pieces: (task(number, groups) for number, groups in pieces)
            return
        stack.enter_context(joblib.parallel_config(backend=backend, n_jobs=jobs, **settings))
        yield parallel


def _dask_client(address: str | None) -> Any:
    if address is None:
        raise RunError("backend dask needs --address, the scheduler's tcp://HOST:PORT")
    try:
        from distributed import Client
    except ImportError:
        raise RunError("backend dask needs the package distributed; install stiction-simbench[dask]") from None
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RunError(f"no dask scheduler answers at {address}: {error}") from None


def _ignore_interrupt() -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides what becomes of it
    signal.signal(signal.SIGINT, signal.SIG_IGN)


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
        from tqdm import tqdm

        # None: only where stderr is a terminal
        self._bar = tqdm(total=total, unit=" scenarios", disable=None if shown is None else not shown, dynamic_ncols=True)
        self._failures = 0
        self._seconds = {"simulating": 0.0, "judging": 0.0, "working": 0.0}
        self.extra: dict[str, Any] = {}

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def add(self, piece: Piece) -> None:
        self._failures += piece.failures
        for name, value in (("simulating", piece.simulating), ("judging", piece.judging), ("working", piece.total)):
            self._seconds[name] += value
        self._bar.set_postfix(failures=self._failures, refresh=False)
        self._bar.update(piece.count)

    def more(self, scenarios: int) -> None:
        if not self._bar.disable:
            self._bar.total = (self._bar.total or 0) + scenarios

    def skip(self, scenarios: int) -> None:
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
            raise RunError(f"thresholds are given for {method!r}, which is not among the methods: {', '.join(names)}")
        check_thresholds(method, registry.load(method).METHOD, values)


def _budgets(names: Sequence[str]) -> tuple[int, int]:
    slow = sum(n != ORACLE and registry.load(n).METHOD.budget == "full" for n in names)
    return len(names) - slow, slow


def _about(name: str) -> dict[str, Any]:
    if name == ORACLE:
        return {"front_end": False, "needs_mv": False, "role": ORACLE, "budget": "full"}
    method = registry.load(name).METHOD
    return {"front_end": method.front_end, "needs_mv": method.needs_mv, "role": method.role, "budget": method.budget}


def _standing(where: Path) -> str:
    whole = len(list((where / store.PARTS).glob("*.json"))) if where.exists() else 0
    return f"{whole} pieces are whole in {where}; continue with --resume"


def _tidy(where: Path) -> None:
    # a run killed between its last two steps
    import shutil

    shutil.rmtree(where / store.PARTS, ignore_errors=True)
    if not all((where / f"{name}.csv").exists() for name in ("scores", "scores_by_axis")):
        from simbench.bench.score import score_run

        score_run(where).write(where)

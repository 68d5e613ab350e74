"""Run a grid: compute its pieces in parallel and write each to disk when it is complete, so that an
interrupted run can continue.

`run_grid` names the steps from a grid to the two tables: read the grid, load the plug-ins, choose
the methods, refuse what cannot run, describe the run in its manifest, compute all pieces
(`compute_piece` simulates and judges one), and join them.
"""

from __future__ import annotations

import contextlib
import pickle
import secrets
import signal
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Unpack, cast

import cloudpickle

from simbench.bench.execute import pieces
from simbench.bench.execute.about_run import describe_run, digests_of, digests_of_own
from simbench.bench.execute.compute_piece import PieceSettings, Receipt, compute_piece
from simbench.bench.execute.distribute import BACKENDS, Runner, workers
from simbench.bench.execute.grid_check import (
    refuse_too_large,
    refuse_wrong_parts,
    size_of,
    tell_copies,
)
from simbench.bench.execute.run_options import RunOptions
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.result import Scores
from simbench.bench.score.shipped import shipped
from simbench.bench.store.benchmark import is_stored, stored_grid
from simbench.bench.store.folder import RunError, write_file
from simbench.bench.store.manifest import MANIFEST, SOURCES, run_key
from simbench.detectors.errors import UserError, nearest
from simbench.detectors.faults import describe_judging
from simbench.detectors.judge import refuse_wrong_forms
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.report.report import choose_methods
from simbench.detectors.sources import Methods, as_plugin, named_methods, split_names
from simbench.files import local_path
from simbench.loop.part_files import added_parts
from simbench.scenarios.expansion import Grid, chunks
from simbench.scenarios.grid import load_grid
from simbench.scenarios.grid_check import MOST_CELLS, MOST_DRAWN_FROM
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.sample import Sample
from simbench.scenarios.settled import SettledGrid, settled_grid

KINDS_OF_PART = ("valve ", "effect ", "plant ", "controller ")  # begin the names of their plug-ins
LIVES = 3  # how often dead workers are replaced before the run gives up


class Interrupted(KeyboardInterrupt):
    """A run stopped by Ctrl-C or SIGTERM; its text names how to resume."""


def run_grid(
    grid: str | Path | Grid,
    out: str | Path | None = None,
    methods: Methods = ("fast",),
    jobs: int = 1,
    **options: Unpack[RunOptions],
) -> Path:
    """Simulate a grid, judge every record by detectors, and write both tables.

    Parameters
    ----------
    grid : str, Path or Grid
        Name of a grid, a TOML file, the folder of a run or baseline, whose loops are simulated
        under their ids, or a grid already read.
    out : str or Path, optional
        Folder of the run; runs/NAME by default.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "fast", "full" and "oracle", and detectors of the caller.
    jobs : int
        Worker processes; -1 uses all cores.
    **options
        Keys of `RunOptions`.

    Returns
    -------
    Path
        Folder of the run, which holds the tables and the manifest.

    Raises
    ------
    RunError
        For options that contradict each other, and for a run that cannot be continued.
    Interrupted
        After Ctrl-C or SIGTERM; its text names how to resume.

    Examples
    --------
    >>> import tempfile
    >>> folder = run_grid("smoke", tempfile.mkdtemp(), ["he"], sets={"disturbance": "none"})
    >>> (folder / "manifest.json").exists()
    True
    """
    return run_scored(grid, out, methods, jobs, **options)[0]


def run_scored(
    grid: str | Path | Grid,
    out: str | Path | None = None,
    methods: Methods = ("fast",),
    jobs: int = 1,
    **options: Unpack[RunOptions],
) -> tuple[Path, Scores | None]:
    """Run a grid as `run_grid` does, and return its scores, too; None where the run was whole."""
    # what is run, and by which methods
    began = time.perf_counter()
    plan = read_plan(grid, options)
    files, parts = _plugin_files(options)
    asked, own = named_methods(methods)

    # read before any plug-in runs, as one may move the file it is in
    digests = digests_of(("", files), *zip(KINDS_OF_PART, parts))
    sources = {}
    for f in _all_there(files, *parts):
        sources[Path(f).name] = Path(f).read_bytes()
    adopted = {}
    for name, detector in own.items():
        adopted[name] = as_plugin(name, detector)

    # refuse what cannot run, and state in the manifest what is run
    with (
        registry.adopted(adopted),
        registry.added(files) as added,
        added_parts(*parts),
    ):
        names = choose_with_oracle(asked, added)
        _refuse_wrong_run(plan, names)
        manifest = describe_run(plan, names, {**digests, **digests_of_own(own)}, options)

        # compute what is not there yet, and join the pieces
        folder = local_path(Path("runs") / plan.name if out is None else out)
        apart = bool(files or own or any(parts))
        backend = options.get("backend", "loky")
        with workers(backend, options.get("address"), jobs, apart) as run, pieces.held(folder):
            pieces.open_run(folder, manifest, options.get("resume", False))
            if pieces.is_finished(folder):
                return folder, None
            for name, source in sources.items():
                write_file(folder / SOURCES / name, source)
            settings = PieceSettings(tuple(names), files, parts, own)
            task = _Task(plan, folder, run_key(manifest), settings)
            shown = options.get("progress")
            with _Bar(shown, len(plan)) as bar, _stop_on_sigterm(), _tell_how_to_resume(folder):
                receipts = _work_pieces(
                    folder, task, run, bar, dict(enumerate(range(*piece) for piece in chunks(plan)))
                )
                times = bar.times(time.perf_counter() - began)
                scores = pieces.finish(folder, receipts, {**manifest, "times": times})
        return folder, scores


def _refuse_wrong_options(options: RunOptions, grid: str | Path | Grid) -> None:
    """Refuse options that there are not, and options that contradict each other or the grid."""
    # a plain dict may hold anything
    for key in options:
        if key not in RunOptions.__annotations__:
            raise RunError(f"unknown option {key!r}: {nearest(key, RunOptions.__annotations__)}")
    backend = options.get("backend", "loky")
    if backend not in BACKENDS:
        raise RunError(f"unknown backend {backend!r}: {nearest(backend, BACKENDS)}")

    # what draws the seed leaves it to nothing else
    sets = options.get("sets") or {}
    fresh = options.get("fresh_seeds")
    if fresh and (options.get("resume") or isinstance(grid, Grid) or "seed" in sets):
        raise RunError(
            "--fresh-seeds draws the grid's seed: it needs a grid by name or file, and neither"
            " --resume nor --set seed= (to resume such a run, give --resume and --set seed= with"
            " the seed that its manifest states)"
        )

    # shipped verdicts and stored loops are those of one grid, unchanged
    changed = fresh or sets or options.get("axes")
    if options.get("with_reference") and changed:
        raise RunError(
            "--with-reference joins verdicts on loops of the grid as the package has it: it needs a"
            " run without --set, --axis and --fresh-seeds"
        )
    if is_stored(grid) and (changed or options.get("n") is not None):
        raise RunError(
            f"{grid} is a run, whose loops are simulated as they stand: it is run without --n,"
            " --set, --axis and --fresh-seeds"
        )


def read_plan(grid: str | Path | Grid, options: RunOptions) -> Grid:
    """Return the grid that is asked for, with its changed settings, or the sample of it."""
    _refuse_wrong_options(options, grid)
    n = options.get("n")

    # read the grid: of a run, at hand, or by its name or file
    if is_stored(grid):
        plan = stored_grid(cast("str | Path", grid))
    elif isinstance(grid, Grid):
        plan = grid
    else:
        if options.get("fresh_seeds"):
            drawn = {"seed": secrets.randbits(62)}
        else:
            drawn = {}
        axes = options.get("axes")
        most = MOST_CELLS if n is None else MOST_DRAWN_FROM
        changes = {**(options.get("sets") or {}), **drawn}
        plan = load_grid(grid, changes, axes, most)
        as_it_stands = str(grid) in grid_names() and not (changes or axes)
        if plan.frozen or (as_it_stands and n is None):
            plan = settled_grid(plan.name)
    if options.get("with_reference"):
        shipped(plan.name)

    # draw the sample where one is asked for
    if n is None:
        return plan
    if isinstance(plan, SettledGrid):
        return plan.some(n)
    return Sample.of(plan, n)


def _plugin_files(options: RunOptions) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return the files of detectors, and those of each part in the order of KINDS_OF_PART."""
    kinds = (
        options.get("plugins", ()),
        options.get("valve_plugins", ()),
        options.get("effect_plugins", ()),
        options.get("plant_plugins", ()),
        options.get("controller_plugins", ()),
    )
    files, *parts = (tuple(str(Path(p).resolve()) for p in some) for some in kinds)
    return files, tuple(parts)


def choose_with_oracle(methods: Iterable[str], added: Sequence[str]) -> list[str]:
    """Return the ids of all methods that judge: those asked for, the plug-ins', then the oracle."""
    asked = split_names(methods)
    names = choose_methods([m for m in asked if m != ORACLE] + list(added))
    return names + [ORACLE] * (ORACLE in asked)  # last, as it is judged last


def _refuse_wrong_run(plan: Grid, names: Sequence[str]) -> None:
    """Refuse, before anything is simulated, what would fail in every worker."""
    refuse_wrong_forms(names)
    refuse_too_large(size_of(plan, *_count_slow_methods(names)), plan.name)
    refuse_wrong_parts(plan)
    tell_copies(plan)


class _Task:
    """What every piece has in common; where it is called, the piece is worked and written."""

    def __init__(self, grid: Grid, folder: Path, key: str, settings: PieceSettings) -> None:
        # packed once, not for every piece; a worker may stand in another folder
        # by value: a caller's detector may be defined in a notebook
        self._packed = cloudpickle.dumps((grid, folder.absolute(), key, settings))

    def __call__(self, number: int, groups: Sequence[int]) -> Receipt:
        grid, folder, key, settings = _unpack(self._packed)
        there = pieces.find_receipt(folder, number, key)
        return there or pieces.write_piece(
            folder, compute_piece(grid, number, groups, settings), key
        )

    def load(self, number: int, groups: Sequence[int]) -> None:
        """Load and compile what a piece needs, by working its first group."""
        grid, _, _, settings = _unpack(self._packed)
        compute_piece(grid, number, groups[:1], settings)


@lru_cache(maxsize=2)
def _unpack(packed: bytes) -> tuple:
    return pickle.loads(packed)


def _work_pieces(
    folder: Path, task: _Task, run: Runner, bar: _Bar, missing: dict[int, Sequence[int]]
) -> list[Receipt]:
    """Return the receipts of some pieces, in order; what a dead worker held is worked again."""
    # again and again what is missing, as long as workers die
    lives = LIVES
    receipts = {}
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

    # in the order of the pieces
    return [receipts[number] for number in sorted(receipts)]


def _worker_died(error: Exception) -> bool:
    # loky, dask and ray name it differently, and none need be installed
    names = {"BrokenProcessPool", "TerminatedWorkerError", "KilledWorker", "WorkerCrashedError"}
    return any(c.__name__ in names for c in type(error).__mro__)


@contextlib.contextmanager
def _stop_on_sigterm() -> Iterator[None]:
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


@contextlib.contextmanager
def _tell_how_to_resume(folder: Path) -> Iterator[None]:
    """Let whatever stops a run tell how much of it is on disk."""
    try:
        yield
    except KeyboardInterrupt:
        met = " ".join(["interrupted", describe_judging()]).rstrip()
        raise Interrupted(f"{met}: {pieces.standing(folder)}") from None
    except UserError as error:
        if not (folder / MANIFEST).exists():  # removed or moved: nothing can be continued
            raise
        raise RunError(f"{error}; {pieces.standing(folder)}") from error


class _Bar:
    """Progress on stderr, and the sums that end in the manifest."""

    def __init__(self, shown: bool | None, total: int) -> None:
        from simbench.progress import Progress

        self._bar = Progress(total=total, unit=" scenarios", desc="run", shown=shown)
        self._failures = 0
        self._seconds = {"simulating": 0.0, "judging": 0.0, "working": 0.0}

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def add(self, receipt: Receipt) -> None:
        self._failures += receipt.failures
        for name in self._seconds:
            self._seconds[name] += getattr(receipt, name)
        self._bar.set_postfix_str(f"failures={self._failures}", refresh=False)
        if receipt.reused:
            count = self._bar.skip
        else:
            count = self._bar.update
        count(receipt.scenarios)

    def times(self, wall: float) -> dict[str, float]:
        return {**{k: round(v, 3) for k, v in self._seconds.items()}, "wall": round(wall, 3)}


def _all_there(*kinds: Sequence[str]) -> Iterator[str]:
    """Yield the files of plug-ins that are there."""
    return (f for files in kinds for f in files if Path(f).is_file())


def _count_slow_methods(names: Sequence[str]) -> tuple[int, int]:
    slow = sum(n != ORACLE and registry.load(n).METHOD.budget == "full" for n in names)
    return len(names) - slow, slow

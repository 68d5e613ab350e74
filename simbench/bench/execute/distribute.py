"""Distribute the pieces of a run over this process, other processes, or a cluster of dask or ray,
and restart workers that die.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

from simbench.bench.execute.compute_piece import Receipt
from simbench.bench.store.checksums import RunError
from simbench.safe_path import safe_path

_Task = Callable[[int, Sequence[int]], Receipt]
_Pieces = list[tuple[int, Sequence[int]]]
Runner = Callable[[_Task, _Pieces], Iterator[Receipt]]
PATIENCE = 6.0  # s, for a scheduler to answer, or for a lost one or the last worker to come back
# s, for a scheduler to answer whose connection is open: its machine may be busy
_SCHEDULER_SECONDS = 60.0
_FIRST = 300.0  # s, for the first worker: some clusters start them when there is work
_LOOK = 1.0  # s between two looks at workers from which nothing comes
_AHEAD = 1000  # pieces handed out and not yet done
_NO_WORKER = "no dask worker is there"
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


@contextlib.contextmanager
def on_processes(jobs: int) -> Iterator[Runner]:
    """Yield a function that has pieces worked by processes of this machine and gives each receipt
    back when it is there.
    """
    if jobs == 1:
        yield lambda task, missing: (task(number, groups) for number, groups in missing)
        return
    from joblib import effective_n_jobs
    from joblib.externals.loky import ProcessPoolExecutor

    settings = {
        "max_workers": effective_n_jobs(jobs),
        "initializer": _begin,
        "env": _ONE_THREAD,
    }
    # a new one: loky's reusable one would be taken by joblib for one of joblib's
    executor: Any = None

    def end(kill: bool) -> None:
        nonlocal executor
        if executor is not None:
            with _loky_silent():
                executor.shutdown(wait=True, kill_workers=kill)
        executor = None

    def run(task: _Task, missing: _Pieces) -> Iterator[Receipt]:
        nonlocal executor
        executor = executor or ProcessPoolExecutor(**settings)
        try:
            yield from _handed_out(
                lambda *piece: executor.submit(task, *piece), missing, lambda: None
            )
        except Exception:  # after a death the next is a new one
            end(kill=True)
            raise

    with safe_path():
        try:
            yield run
        except BaseException:
            end(kill=True)
            raise
        end(kill=False)


@contextlib.contextmanager
def _loky_silent() -> Iterator[None]:
    """Let loky's thread end without a traceback: told to kill its workers, it may look for a piece
    that it has just taken back.
    """
    usual = threading.excepthook

    def hook(about: threading.ExceptHookArgs) -> None:
        if about.thread is None or about.thread.name != "ExecutorManagerThread":
            usual(about)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = usual


@contextlib.contextmanager
def on_cluster(address: str | None) -> Iterator[Runner]:
    """Yield a function that has pieces worked by a dask cluster and gives each receipt back when it
    is there.
    """
    client = _client(address)

    def run(task: _Task, missing: _Pieces) -> Iterator[Receipt]:
        return _handed_out(
            lambda *piece: client.submit(task, *piece, pure=False), missing, lambda: _gone(client)
        )

    try:
        yield run
    finally:
        with contextlib.suppress(Exception):  # of a cluster that is gone
            client.close(timeout=_LOOK)


@contextlib.contextmanager
def on_ray(address: str | None, jobs: int) -> Iterator[Runner]:
    """Yield a function that has pieces worked by ray and gives each receipt back when it is
    there.
    """
    try:
        import ray  # type: ignore[import-not-found]
    except ImportError:
        raise RunError(
            "backend ray needs the package ray; install stiction-simbench[ray]"
        ) from None
    from joblib import effective_n_jobs

    where = (
        {"num_cpus": effective_n_jobs(jobs), "include_dashboard": False}
        if address is None
        else {"address": address}
    )
    quiet = {
        "log_to_driver": False,
        "logging_level": "ERROR",
        "runtime_env": {"env_vars": _ONE_THREAD},
    }
    safe = contextlib.ExitStack()
    try:
        if address not in (None, "auto"):  # ray itself would go on asking for minutes
            host, _, port = address.rpartition("://")[2].rpartition(":")
            socket.create_connection((host, int(port)), timeout=PATIENCE).close()
        safe.enter_context(safe_path())
        ray.init(**where, **quiet)
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        safe.close()
        reason = str(error).splitlines()[0]
        raise RunError(
            f"no ray cluster answers at {address}: {reason}; its HOST:PORT is needed"
        ) from None

    def run(task: _Task, missing: _Pieces) -> Iterator[Receipt]:
        work = ray.remote(lambda *piece: task(*piece))
        try:
            yield from _handed_out(
                lambda *piece: work.remote(*piece).future(), missing, lambda: None
            )
        except ray.exceptions.RayTaskError as error:  # what the piece itself raised
            raise getattr(error, "cause", error) from None
        except ray.exceptions.WorkerCrashedError:  # over and over; the run counts how often
            raise
        except ray.exceptions.RayError as error:
            raise RunError(f"ray gave up: {str(error).splitlines()[0]}") from None

    try:
        yield run
    finally:
        ray.shutdown()
        safe.close()


def _handed_out(
    submit: Callable, missing: _Pieces, gone: Callable[[], tuple[str, float] | None]
) -> Iterator[Receipt]:
    """Yield receipts as they come; `gone` returns what is missing when none does, and for how long
    that may be.
    """
    done: queue.SimpleQueue = queue.SimpleQueue()
    waiting, left = set(), iter(missing)

    def hand_out(count: int) -> None:
        for piece in islice(left, count):
            waiting.add(future := submit(*piece))
            future.add_done_callback(done.put)

    hand_out(_AHEAD)
    since, begun = time.monotonic(), False
    while waiting:
        try:
            future = done.get(timeout=_LOOK)
        except queue.Empty:
            lacking, quiet = gone(), time.monotonic() - since
            if lacking is None:
                since, begun = time.monotonic(), True
            elif quiet > (_FIRST if lacking[0] == _NO_WORKER and not begun else lacking[1]) - _LOOK:
                raise RunError(f"{lacking[0]}, and nothing came for {quiet:.0f} s") from None
            continue
        if future.cancelled():
            raise RunError("the dask scheduler is gone, and what it had to do with it")
        waiting.discard(future)
        yield future.result()
        hand_out(1)
        since, begun = time.monotonic(), True


def _client(address: str | None) -> Any:
    if address is None:
        raise RunError("backend dask needs --address, the scheduler's tcp://HOST:PORT")
    try:
        from distributed import Client
        from distributed.comm.addressing import resolve_address
    except ImportError:
        raise RunError(
            "backend dask needs the package distributed; install stiction-simbench[dask]"
        ) from None
    try:
        # a client of an address that is none complains once more when it is thrown away
        resolve_address(address)
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RunError(
            f"no dask scheduler answers at {address}: {error}; its tcp://HOST:PORT is needed"
        ) from None


def _gone(client: Any) -> tuple[str, float] | None:
    # the connection of a scheduler that died is closed at once; one that is only slow keeps it
    if client.status == "running":
        try:
            workers = client.sync(client.scheduler.ncores, callback_timeout=_LOOK)
            return None if workers else (_NO_WORKER, PATIENCE)
        except TimeoutError:
            return "the dask scheduler does not answer", _SCHEDULER_SECONDS
        except OSError:
            pass
    return "the dask scheduler is gone", PATIENCE


def _begin() -> None:
    """Set up a worker: Ctrl-C reaches the whole process group, and the parent alone decides what
    becomes of it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this worker once its parent was killed: nobody else would tell it that no piece comes."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)

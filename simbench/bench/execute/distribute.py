"""Distribute the pieces of a run over copies of this process, or where there can be none, and over
a cluster of dask or ray, over the workers that joblib has.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from functools import partial
from types import FrameType
from typing import Any, Protocol

from joblib import Parallel, delayed, effective_n_jobs, parallel_config

from simbench.bench.execute.compute_piece import Receipt
from simbench.bench.store.folder import RunError
from simbench.detectors.faults import describe_judging
from simbench.safe_path import safe_path

BACKENDS = ("loky", "dask", "ray")
_Pieces = list[tuple[int, Sequence[int]]]


class _PieceTask(Protocol):
    """Works a piece by its number and groups; `load` does what every worker does first."""

    def __call__(self, number: int, groups: Sequence[int]) -> Receipt: ...

    def load(self, number: int, groups: Sequence[int]) -> None: ...


Runner = Callable[[_PieceTask, _Pieces], Iterator[Receipt]]
_PATIENCE = 6.0  # s, for a scheduler to answer
_WORKERS = 300.0  # s, for the first worker of a cluster: some start them when there is work
_LOOK = 1.0  # s between two looks of a worker at its parent
# s in which workers say what Ctrl-C met: beside three busy processes they were ended before it in
# two of six tries without any
_LAST_WORDS = 0.5


@contextlib.contextmanager
def workers(
    backend: str, address: str | None, jobs: int, plugins: bool = False
) -> Iterator[Runner]:
    """Yield a function that has pieces computed by workers and yields each receipt when it is
    there; with plug-ins, one of which may end its process, workers are no copies of this one.
    """
    if backend == "loky" and jobs == 1:
        yield lambda task, missing: (task(number, groups) for number, groups in missing)
        return
    if backend == "loky" and not plugins and _may_fork():
        with _workers_heard():
            yield partial(_work_in_copies, effective_n_jobs(jobs))
        return
    with contextlib.ExitStack() as stack:
        stack.enter_context(_workers_heard())
        stack.enter_context(safe_path())
        settings = {
            "loky": lambda: {
                "n_jobs": jobs,
                "initializer": _set_up_worker,
                "inner_max_num_threads": 1,
            },
            "dask": lambda: _join_dask(address, stack),
            "ray": lambda: _join_ray(address, jobs, stack),
        }[backend]()
        stack.enter_context(parallel_config(backend, **settings))
        # ray hands nothing back before all is done
        order = "list" if backend == "ray" else "generator_unordered"

        def run(task: _PieceTask, missing: _Pieces) -> Iterator[Receipt]:
            parallel: Any = Parallel(return_as=order, batch_size=1)
            try:
                yield from parallel(delayed(task)(number, groups) for number, groups in missing)
            except CancelledError as error:
                reason = str(error).splitlines()[-1]
                raise RunError(f"the {backend} scheduler is gone: {reason}") from None

        yield run


@contextlib.contextmanager
def _workers_heard() -> Iterator[None]:
    """Let Ctrl-C, which reaches workers too, end them only when each has said what it judges."""
    plain = signal.default_int_handler
    alone = threading.current_thread() is threading.main_thread()
    if not alone or signal.getsignal(signal.SIGINT) is not plain:
        yield
        return

    def wait(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, plain)  # a second Ctrl-C does not wait
        time.sleep(_LAST_WORDS)
        plain(number, frame)

    signal.signal(signal.SIGINT, wait)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, plain)


def _may_fork() -> bool:
    """Return whether a copy of this process would be whole: no other thread holds a lock in it."""
    return sys.platform == "linux" and threading.active_count() == 1


def _work_in_copies(jobs: int, task: _PieceTask, missing: _Pieces) -> Iterator[Receipt]:
    """Yield the receipts of pieces that copies of this process work: libraries and kernels are
    loaded once, before they are made.
    """
    task.load(*missing[0])
    others = multiprocessing.active_children()
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(min(jobs, len(missing)), context, _set_up_worker) as pool:
        try:
            working = [pool.submit(task, number, groups) for number, groups in missing]
            for done in as_completed(working):
                yield done.result()
        except BaseException:
            # nobody waits for the pieces that are being worked
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - set(others):
                child.terminate()
            raise


def _join_dask(address: str | None, stack: contextlib.ExitStack) -> dict[str, Any]:
    """Return the settings of joblib for a running scheduler of dask."""
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
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RunError(
            f"no dask scheduler answers at {address}: {error}; its tcp://HOST:PORT is needed"
        ) from None
    stack.callback(client.close)
    return {"client": client, "n_jobs": -1, "wait_for_workers_timeout": _WORKERS}


def _join_ray(address: str | None, jobs: int, stack: contextlib.ExitStack) -> dict[str, Any]:
    """Return the settings of joblib for a cluster of ray, or for ray on this machine."""
    # The package ray is optional
    try:
        import ray  # type: ignore[import-not-found]
        from ray.util.joblib import register_ray  # type: ignore[import-not-found]
    except ImportError:
        raise RunError(
            "backend ray needs the package ray; install stiction-simbench[ray]"
        ) from None

    # The cluster answers, or it is said that none does
    try:
        ray.init(address, log_to_driver=False, logging_level="ERROR")
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise RunError(
            f"no ray cluster answers at {address}: {reason}; its HOST:PORT is needed"
        ) from None

    # Joblib hands its calls to it until the stack is closed
    stack.callback(ray.shutdown)
    register_ray()
    return {"n_jobs": jobs}


def _set_up_worker() -> None:
    """Set up a worker process: Ctrl-C reaches the whole process group, and the parent alone decides
    what becomes of it.
    """
    signal.signal(signal.SIGINT, _tell_current)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _tell_current(*_: object) -> None:
    """Tell what this worker is judging: a detector that hangs is found by that."""
    if met := describe_judging():
        os.write(2, f"a worker is interrupted {met}\n".encode())


def _end_with(parent: int) -> None:
    """End this worker once its parent was killed: nobody else would tell it that no piece comes."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)

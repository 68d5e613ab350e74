"""Distribute the pieces of a run over processes of this machine, or over a cluster of dask or ray:
joblib hands them out.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from typing import Any

from joblib import Parallel, delayed, parallel_config

from simbench.bench.execute.compute_piece import Receipt
from simbench.bench.store.folder import RunError
from simbench.safe_path import safe_path

BACKENDS = ("loky", "dask", "ray")
_Task = Callable[[int, Sequence[int]], Receipt]
_Pieces = list[tuple[int, Sequence[int]]]
Runner = Callable[[_Task, _Pieces], Iterator[Receipt]]
_PATIENCE = 6.0  # s, for a scheduler to answer
_WORKERS = 300.0  # s, for the first worker of a cluster: some start them when there is work
_LOOK = 1.0  # s between two looks of a worker at its parent


@contextlib.contextmanager
def workers(backend: str, address: str | None, jobs: int) -> Iterator[Runner]:
    """Yield a function that has pieces computed by workers and yields each receipt when it is
    there.
    """
    if backend == "loky" and jobs == 1:
        yield lambda task, missing: (task(number, groups) for number, groups in missing)
        return
    with contextlib.ExitStack() as stack:
        stack.enter_context(safe_path())
        settings = {
            "loky": lambda: {"n_jobs": jobs, "initializer": _begin, "inner_max_num_threads": 1},
            "dask": lambda: _dask(address, stack),
            "ray": lambda: _ray(address, jobs, stack),
        }[backend]()
        stack.enter_context(parallel_config(backend, **settings))
        # ray hands nothing back before all is done
        order = "list" if backend == "ray" else "generator_unordered"

        def run(task: _Task, missing: _Pieces) -> Iterator[Receipt]:
            parallel: Any = Parallel(return_as=order, batch_size=1)
            try:
                yield from parallel(delayed(task)(number, groups) for number, groups in missing)
            except CancelledError as error:
                reason = str(error).splitlines()[-1]
                raise RunError(f"the {backend} scheduler is gone: {reason}") from None

        yield run


def _dask(address: str | None, stack: contextlib.ExitStack) -> dict[str, Any]:
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


def _ray(address: str | None, jobs: int, stack: contextlib.ExitStack) -> dict[str, Any]:
    """Return the settings of joblib for a cluster of ray, or for ray on this machine."""
    try:
        import ray  # type: ignore[import-not-found]
        from ray.util.joblib import register_ray  # type: ignore[import-not-found]
    except ImportError:
        raise RunError(
            "backend ray needs the package ray; install stiction-simbench[ray]"
        ) from None
    try:
        ray.init(address, log_to_driver=False, logging_level="ERROR")
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise RunError(
            f"no ray cluster answers at {address}: {reason}; its HOST:PORT is needed"
        ) from None
    stack.callback(ray.shutdown)
    register_ray()
    return {"n_jobs": jobs}


def _begin() -> None:
    """Set up a worker process: Ctrl-C reaches the whole process group, and the parent alone decides
    what becomes of it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    """End this worker once its parent was killed: nobody else would tell it that no piece comes."""
    while os.getppid() == parent:
        time.sleep(_LOOK)
    os._exit(1)

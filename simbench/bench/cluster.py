"""Pieces of a run on a dask cluster, and an end soon after the cluster's."""

from __future__ import annotations

import contextlib
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any

from simbench.bench.checksums import RunError
from simbench.bench.pieces import Receipt

Pieces = list[tuple[int, Sequence[int]]]
Runner = Callable[[Callable[[int, Sequence[int]], Receipt], Pieces], Iterator[Receipt]]
PATIENCE = 8.0  # s, for a scheduler to answer, or for a lost one or the last worker to come back
FIRST = 300.0  # s, for the first worker: some clusters start them when there is work
LOOK = 1.0  # s between two looks at a cluster from which nothing comes
AHEAD = 1000  # pieces the scheduler knows of at a time


@contextlib.contextmanager
def on_cluster(address: str | None) -> Iterator[Runner]:
    """Yield a function that has pieces worked by a dask cluster and gives each receipt back when it is there.

    Parameters
    ----------
    address : str or None
        Of the scheduler ("tcp://HOST:PORT").

    Yields
    ------
    callable
        It raises RunError when the scheduler, or every worker, has been gone for 8 s; a worker that dies among others is no
        matter, its pieces are worked elsewhere.

    Raises
    ------
    RunError
        When no scheduler answers, or dask is not installed.
    """
    client = _client(address)
    try:
        yield lambda task, missing: _receipts(client, task, missing)
    finally:
        with contextlib.suppress(Exception):  # of a cluster that is gone
            client.close(timeout=LOOK)


def _client(address: str | None) -> Any:
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


def _receipts(client: Any, task: Callable[[int, Sequence[int]], Receipt], missing: Pieces) -> Iterator[Receipt]:
    done: queue.SimpleQueue = queue.SimpleQueue()
    waiting, left = set(), iter(missing)

    def submit(count: int) -> None:
        for number, groups in islice(left, count):
            future = client.submit(task, number, groups, pure=False)
            waiting.add(future)
            future.add_done_callback(done.put)

    try:
        submit(AHEAD)
        since, patience = time.monotonic(), FIRST
        while waiting:
            try:
                future = done.get(timeout=LOOK)
            except queue.Empty:
                why = _gone(client)
                if why is None:
                    since, patience = time.monotonic(), PATIENCE
                elif time.monotonic() - since > (PATIENCE if "scheduler" in why else patience) - LOOK:
                    raise RunError(f"{why}, and nothing came for {time.monotonic() - since:.0f} s") from None
                continue
            if future.cancelled():
                raise RunError("the dask scheduler is gone, and what it had to do with it")
            waiting.discard(future)
            yield future.result()
            submit(1)
            since, patience = time.monotonic(), PATIENCE
    finally:
        if waiting and client.status == "running":
            client.cancel(list(waiting))


def _gone(client: Any) -> str | None:
    try:
        workers = client.sync(client.scheduler.ncores, callback_timeout=LOOK) if client.status == "running" else None
    except (TimeoutError, OSError):
        workers = None
    if workers is None:
        return "the dask scheduler is gone"
    return None if workers else "no dask worker is there"

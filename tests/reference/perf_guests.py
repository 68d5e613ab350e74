"""What a worker process costs the main job: its pieces worked with one detector more, in its worker
or in this process.
"""

from __future__ import annotations

import resource
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import detectors.methods as built_in
from detectors.plugins.registry import methods
from scenarios.grid import Grid, load_grid
from simbench.bench.execute import plugin_host as guests
from simbench.bench.execute.work import WorkSettings, work
from simbench.bench.scenario.oracle import ORACLE

PLUGINS = ("horch", "he", "ellipse")  # copies of these, as a stranger would hand them in
GROUPS, ROUNDS = 20, 9
MOST = 0.05  # of the whole job's time
WORKERS = 2  # of `make bench`: each starts a process of the plug-in's


def seconds(do: Callable[[], object]) -> float:
    """CPU time of some work, that of a plug-in's process with it."""
    before = _used()
    do()
    return _used() - before


def _used() -> float:
    own = resource.getrusage(resource.RUSAGE_SELF)
    workers = [host._process.pid for _, host in methods._hosts.values() if host._process]
    return own.ru_utime + own.ru_stime + sum(map(_of_process, workers))


def _of_process(pid: int) -> float:
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


def piece(grid: Grid, index: int, names: list[str]) -> None:
    """Work one group as a worker of the job does for the first time."""
    guests._theory.cache_clear()
    work(grid, 0, [index], WorkSettings(tuple(names)))


def compared(grid: Grid, names: list[str], inside: str, isolated: str) -> tuple[float, float]:
    """CPU s of some groups with the plug-in here, and in its process; by turns, each group at its
    quickest.
    """
    best = np.full((2, GROUPS), np.inf)
    for turn in range(ROUNDS):
        for g, index in enumerate(np.linspace(0, grid.group_count - 1, GROUPS).astype(int)):
            for k in (0, 1) if turn % 2 else (1, 0):
                extra = (inside, isolated)[k]
                took = seconds(
                    lambda index=index, extra=extra: piece(
                        grid, int(index), [*names, extra, ORACLE]
                    )
                )
                best[k, g] = min(best[k, g], took)
    return float(best[0].sum()), float(best[1].sum())


def main() -> int:
    folder, grid, good = Path(tempfile.mkdtemp()), load_grid("chapter"), True
    fast = [n for n in methods.names() if methods.load(n).METHOD.budget == "fast"]
    print(
        f"CPU s of {GROUPS} of {grid.group_count} groups of the chapter's grid, each at its"
        f" quickest of {ROUNDS} turns"
    )
    for name in PLUGINS:
        source = Path(built_in.__path__[0]) / f"{name}.py"
        inside, outside = (
            shutil.copy(source, folder / f"{name}_{place}.py") for place in ("inside", "outside")
        )
        here, (there,) = methods.add_file(inside), methods.add_hosted(outside)
        host = methods.host_of(there)
        piece(grid, 0, [*fast, there])
        start = _of_process(host._process.pid)  # all its modules read, and its first record judged
        one, other = compared(grid, fast, here, there)
        whole = one * grid.group_count / GROUPS
        each, begun = (other - one) / one, WORKERS * start / whole
        good &= each + begun <= MOST
        print(
            f"{name:<8} here {one:.3f} isolated {other:.3f}: {each:+.1%}, and {begun:.1%} to start"
            " its processes",
            flush=True,
        )
        for extra in (here, there):
            methods.forget(extra)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

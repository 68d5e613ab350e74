"""What isolation costs: records of the main job judged with one plug-in more, in a process of its own or in this one."""

from __future__ import annotations

import resource
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

import detectors.methods as built_in
from detectors.judge import check_thresholds
from detectors.registry import methods
from scenarios.grid import load_grid
from simbench.bench.resolve import resolve
from simbench.bench.truth import simulate_with_truth
from simbench.bench.work import judge_both

PLUGINS = ("horch", "he", "ellipse")  # copies of these, as a stranger would hand them in
GROUPS, ROUNDS = 24, 7
MOST = 0.05  # of the whole job's time


def work(names: list[str], extra: str | None) -> None:
    """Simulate and judge as a run does."""
    chosen = {n: check_thresholds(n, methods.load(n).METHOD, {}) for n in [*names, *([extra] if extra else [])]}
    grid = load_grid("chapter")
    for index in np.linspace(0, grid.group_count - 1, GROUPS).astype(int):
        for scenario in resolve(grid.group(int(index))):
            judge_both(simulate_with_truth(scenario.loop, scenario.seed)[0].record, chosen)


def seconds(names: list[str], extra: str | None) -> float:
    """CPU time of the work, that of the plug-in's process with it (counted once it has ended)."""
    before = _used()
    work(names, extra)
    host = methods.guest(extra) if extra else None
    if host is not None:
        host.close()
    return _used() - before


def _used() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(u.ru_utime + u.ru_stime for u in used)


def main() -> int:
    folder = Path(tempfile.mkdtemp())
    fast = [n for n in methods.names() if methods.load(n).METHOD.budget == "fast"]
    work(fast, None)
    good = True
    print(f"CPU s of {GROUPS} groups of the chapter's grid, minima of {ROUNDS} interleaved rounds")
    for name in PLUGINS:
        source = Path(built_in.__path__[0]) / f"{name}.py"
        inside, outside = (shutil.copy(source, folder / f"{name}_{place}.py") for place in ("inside", "outside"))
        contenders = {"without": None, "inside": methods.add_file(inside), "isolated": methods.add_guest(outside)}
        times: dict[str, list[float]] = {place: [] for place in contenders}
        for _ in range(ROUNDS):
            for place, extra in contenders.items():
                times[place].append(seconds(fast, extra))
        best = {place: min(some) for place, some in times.items()}
        start = _start(contenders["isolated"])
        more = (best["isolated"] - start - best["inside"]) / best["inside"]
        good &= more <= MOST
        shown = "".join(f" {place} {t:.3f}" for place, t in best.items())
        print(f"{name:<10}{shown}  start {start:.3f}  share {more:+.1%}")
    return 0 if good else 1


def _start(name: str) -> float:
    """CPU time of a process that judges one record: once per worker and run, all its modules read."""
    used, chosen = [], {name: check_thresholds(name, methods.load(name).METHOD, {})}
    record = simulate_with_truth(resolve(load_grid("chapter").group(0))[0].loop, 0)[0].record
    for _ in range(3):
        before, host = _used(), methods.guest(name)
        assert host is not None
        judge_both(record, chosen)
        host.close()
        used.append(_used() - before)
    return min(used)


if __name__ == "__main__":
    sys.exit(main())

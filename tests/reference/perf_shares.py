"""Where a scenario's CPU time goes: loop kernel, its set-up, truth, theory, front end, each detector, store and glue."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import detectors.prepared
import detectors.registry
import simbench.bench.resolve
import simbench.bench.truth
import simbench.bench.work as work
import simbench.loop.kernel
import simbench.theory.cycle
from detectors.report import choose_methods
from scenarios.grid import load_grid
from simbench.bench import store, tables

GRID, EVERY = "chapter", 12  # every so many-th group of the grid
PIECE = 64  # groups per piece


class Meter:
    """CPU time by name: whoever runs is charged, and what it calls under another name is not."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._running, self._since = ["glue"], time.process_time()

    def wrap(self, name: str, function: Callable) -> Callable:
        """Return the function, its time charged to `name`."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._charge()
            self._running.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                self._charge()
                self._running.pop()

        return timed

    def _charge(self) -> None:
        now = time.process_time()
        self.seconds[self._running[-1]] = self.seconds.get(self._running[-1], 0.0) + now - self._since
        self._since = now


def metered(meter: Meter, names: list[str]) -> list[tuple[Any, str, Any]]:
    """Put the meter into everything that has a line of its own; return what must be put back."""
    simulate = meter.wrap("simulate, without its kernel", simbench.bench.truth.simulate)
    compiled = simbench.loop.kernel.compiled
    places = [
        (simbench.loop.kernel, "compiled", lambda *a: meter.wrap("loop kernel", compiled(*a))),
        (simbench.bench.truth, "simulate", simulate),
        (simbench.bench.resolve, "simulate", simulate),
        (work, "resolve", meter.wrap("cell: sampling, noise, loads", work.resolve)),
        (work, "simulate_with_truth", meter.wrap("truth labels", work.simulate_with_truth)),
        (work, "_theory", meter.wrap("theory columns", work._theory)),
        (simbench.bench.resolve, "cycle_start", meter.wrap("cell: theory", simbench.bench.resolve.cycle_start)),
        (detectors.prepared, "find_oscillation", meter.wrap("front end", detectors.prepared.find_oscillation)),
        (detectors.prepared, "inspect", meter.wrap("quality flags", detectors.prepared.inspect)),
        (work, "_scenario_row", meter.wrap("rows", work._scenario_row)),
        (work, "_verdict_row", meter.wrap("rows", work._verdict_row)),
        (tables, "encode", meter.wrap("store", tables.encode)),
        (store, "write_piece", meter.wrap("store", store.write_piece)),
    ]
    for name in names:
        module = detectors.registry.methods.load(name)
        places.append((module, "detect", meter.wrap(name, module.detect)))
    before = [(owner, attribute, getattr(owner, attribute)) for owner, attribute, _ in places]
    for owner, attribute, timed in places:
        setattr(owner, attribute, timed)
    return before


def shares(budget: str, every: int = EVERY) -> tuple[dict[str, float], int]:
    """Run a slice of the grid as a worker does; return milliseconds of CPU per scenario by name, and the scenarios."""
    plan, names = load_grid(GRID), choose_methods([budget])
    groups = range(0, plan.group_count, every)
    work.work(plan, 0, groups[:12], names)  # what compiles, compiles now
    meter = Meter()
    before = metered(meter, names)
    count = 0
    try:
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / store.PARTS).mkdir()
            start = time.process_time()
            for number in range(0, len(groups), PIECE):
                piece = work.work(plan, number, groups[number : number + PIECE], names)
                store.write_piece(Path(folder), piece)
                count += piece.count
            meter._charge()
            total = time.process_time() - start
    finally:
        for owner, attribute, function in before:
            setattr(owner, attribute, function)
    assert abs(sum(meter.seconds.values()) - total) < 0.05 * total
    return {k: 1e3 * v / count for k, v in meter.seconds.items()}, count


if __name__ == "__main__":
    for budget in sys.argv[1:] or ["fast", "full"]:
        found, count = shares(budget)
        total = sum(found.values())
        print(f"{budget}: {total:.2f} ms of CPU per scenario, {count} scenarios")
        for name, value in sorted(found.items(), key=lambda item: -item[1]):
            print(f"  {name:<30} {value:8.3f} ms {value / total:7.1%}")

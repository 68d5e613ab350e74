"""Simulate chosen scenarios of a grid in any order and on any number of workers, with the same bits
as in a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import groupby
from typing import Any

from simbench.bench.execute.compute_piece import SimulatedScenario, simulated
from simbench.bench.execute.distribute import on_processes
from simbench.bench.execute.plugin_host import settled
from simbench.detectors.compiled import one_thread
from simbench.progress import Progress
from simbench.scenarios.grid import Grid

Pick = tuple[int, int]  # a scenario of a grid: its group, and its place in it
_PIECE = 20  # scenarios


def simulate_picks(
    grid: Grid, picks: Iterable[Pick], jobs: int, look: Callable[[SimulatedScenario], Any]
) -> dict[Pick, Any]:
    """Return what `look` makes of each scenario, where it was simulated; its members that a group
    lacks are left out.
    """
    wanted = sorted(picks)
    groups = [list(some) for _, some in groupby(wanted, key=lambda pick: pick[0])]
    pieces: list[list[Pick]] = [[]]
    for some in groups:  # a group is set up once
        if len(pieces[-1]) >= _PIECE:
            pieces.append([])
        pieces[-1] += some
    results: dict[Pick, Any] = {}
    bar = Progress(total=len(wanted), desc="simulated", delay=1.0)
    with on_processes(jobs) as run, bar:
        done: Any = run(partial(_piece, grid, look), list(enumerate(pieces)))  # pyright: ignore[reportArgumentType]
        for number, some in done:
            results |= some
            bar.update(len(pieces[number]))
    return {pick: results[pick] for pick in wanted if pick in results}


def _piece(
    grid: Grid, look: Callable[[SimulatedScenario], Any], number: int, picks: Sequence[Pick]
) -> tuple[int, dict[Pick, Any]]:
    results = {}
    with one_thread():
        for index, some in groupby(picks, key=lambda pick: pick[0]):
            scenarios = settled(grid.group(index))
            for pick in some:
                if pick[1] < len(scenarios):
                    scenario, wrong = scenarios[pick[1]]
                    results[pick] = look(simulated(scenario, wrong, index))
    return number, results

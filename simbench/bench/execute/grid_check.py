"""Check a grid before it is run: its plug-ins and parameters, its size, and that each kind of cell
gives a valid loop.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.bench.execute.settle_group import refuse_unsettled, settled
from simbench.bench.store.manifest import RunError
from simbench.detectors.errors import UserError, naming
from simbench.loop.disturbance import DISTURBANCES
from simbench.loop.disturbance import PARAMETERS as OF_LOADS
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import suggestion
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid_check import say
from simbench.scenarios.grid_file import More

MOST_SCENARIOS = 1_000_000  # of one run
# measured on the chapter's grid: a scenario without detectors, a fast and a slow method (s of one
# core); rows on disk (bytes)
_SECONDS = 0.008
_FAST_METHOD_SECONDS = 0.0008
_FULL_METHOD_SECONDS = 0.05
ROW = 600
_VERDICT = 70


@dataclass(frozen=True)
class GridSize:
    """How large a run will be, before it begins."""

    cells: int
    scenarios: int
    samples: float  # of all records together
    bytes: float  # on disk
    seconds: float  # of one core

    def __str__(self) -> str:
        """One clause."""
        return (
            f"{self.cells} cells, {self.scenarios} scenarios, about {self.samples:.2g} samples, "
            f"{self.bytes / 1e6:.3g} MB and {self.seconds / 60:.3g} minutes of one core"
        )


def size_of(plan: Grid, fast: int, slow: int) -> GridSize:
    """Estimate a run's size without building a cell."""
    # Scenarios, and the samples of each
    scenarios = len(plan)
    if plan.content.loop is not None:
        n = float(plan.content.loop.get("sampling", {}).get("n", 4000))
    else:
        n = sum(_samples_of_record(plan, block) for block in plan.content.block) / len(
            plan.content.block
        )

    # Seconds and bytes by the constants of a measured run
    long = max(n / 1500.0, 0.2)  # the constants are for records of this length
    seconds = (
        scenarios * long * (_SECONDS + _FAST_METHOD_SECONDS * fast + _FULL_METHOD_SECONDS * slow)
    )
    return GridSize(
        plan.cells, scenarios, scenarios * n, scenarios * (ROW + _VERDICT * (fast + slow)), seconds
    )


def refuse_too_large(size: GridSize, name: str) -> None:
    """Raise RunError when a run has more scenarios than its tables are made for."""
    if size.scenarios > MOST_SCENARIOS:
        raise RunError(
            f"{name}: {size}; at most {MOST_SCENARIOS} scenarios are run; --n 10000 draws so many"
            " of them at random"
        )


def tell_copies(plan: Grid) -> None:
    """Say on stderr where the repeats of a cell are the same record, as nothing in it is random."""
    # a grid of blocks draws the numbers of every loop
    if plan.content.loop is None or plan.content.repeats == 1:
        return

    # the first two repeats of the first cell, sample by sample
    whole = Grid(plan.name, plan.content, plan.overrides)
    try:
        scenarios = [settled(whole.group(index))[0][0] for index in (0, whole.cells)]
        records = [simulate(scenario.loop, scenario.seed).record for scenario in scenarios]
    # what a model does on unusual numbers is an error of its scenario, which the run keeps
    except (Exception, SystemExit):
        return
    if all(map(np.array_equal, *((record.op, record.pv) for record in records))):
        print(
            f"grid {plan.name}: repeats of its first loop are the same record, as nothing in it is"
            " random; each record counts once",
            file=sys.stderr,
        )


def refuse_wrong_parts(plan: Grid) -> None:
    """Raise one error that names every wrong disturbance, valve and effect of a grid, and try a
    cell of each block.
    """
    say(plan.name, list(dict.fromkeys(_find_wrong_parts(plan))))
    with naming(f"grid {plan.name}"):
        for index in plan.samples():
            refuse_unsettled(plan.group(index))


def _samples_of_record(plan: Grid, block: Any) -> float:
    def middle(key: str) -> float:
        value = block.axes.get(key) or block.draw.get(key) or plan.content.draw.get(key) or 40.0
        if isinstance(value, tuple):
            ends = value
        else:
            ends = (value,)
        return sum(map(float, ends)) / len(ends)

    return middle("samples_per_period") * middle("periods")


def _find_wrong_parts(plan: Grid) -> Iterator[str]:
    # Disturbances: a known type, parameters that it has
    content = plan.content
    for name, load in content.disturbances.items():
        where = f"disturbance {name!r}"
        if load.type not in DISTURBANCES:
            yield f"{where}: type = {load.type!r} is unknown, {suggestion(load.type, DISTURBANCES)}"
            continue
        given = {"amplitude": load.amplitude, "period": load.period, **load.parameters}
        yield from _check_parameters(
            where, OF_LOADS[load.type], given, ("amplitude", "period", "lag", "start")
        )

    # Valves and effects of every member, and which member an echo is of
    known = VALVES.names()
    for block in content.block:
        first = next((m.name for m in block.member if m.echo is None), None)
        echoed = {m.of or first for m in block.member if m.echo is not None}
        for member in block.member:
            where = f"block {block.name!r}: member {member.name!r}"
            for valve in (member.valve,) if isinstance(member.valve, str) else member.valve:
                if valve not in known:
                    yield f"{where}: valve {valve!r} is unknown, {suggestion(valve, known)}"
                elif member.name in echoed and not VALVES.load(valve).FRICTION:
                    yield f"{where}: valve {valve!r} has no friction that could be echoed"

    # The parameters of valves and effects
    for kind, folder, parts in (
        ("valve", VALVES, content.valves),
        ("effect", EFFECTS, content.effects),
    ):
        for name, part in parts.items():
            yield from _check_part(f"{kind} {name!r}", folder, name, part)


def _check_part(where: str, folder: Any, name: str, part: More) -> Iterator[str]:
    asked = part.name or name
    if asked not in folder.names():
        yield f"{where}: {asked!r} is unknown, {suggestion(asked, folder.names())}"
    else:
        yield from _check_parameters(
            where, folder.load(asked).PARAMETERS, part.parameters, tuple(part.scale)
        )


def _check_parameters(
    where: str, schema: Mapping[str, Any], given: Mapping[str, Any], scaled: Sequence[str]
) -> Iterator[str]:
    for key, value in given.items():
        if key not in schema:
            yield f"{where}: {key!r} is no parameter of it, {suggestion(key, schema)}"
            continue
        for end in value if isinstance(value, tuple) else (value,):
            # a number that waits for the cell's scale: its sign alone is known
            low = getattr(schema[key], "low", None)
            if key in scaled and isinstance(end, (int, float)):
                if low is not None and low >= 0.0 > end:
                    yield f"{where}: {key} = {end:g}; it must not be below 0"
                elif end == 0.0 and getattr(schema[key], "positive", False):
                    yield f"{where}: {key} = 0; it must be above 0"
                continue
            try:
                schema[key].read(end, key, where)
            except UserError as error:
                yield str(error)

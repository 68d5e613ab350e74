"""Test a grid against its contract: it is valid, its parts exist, its groups are reproducible, and
no two scenarios are equal.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from simbench.bench.execute.grid_check import refuse_wrong_parts
from simbench.bench.scenario.resolve import resolve
from simbench.detectors.contract.engine import Contract, each_once
from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.errors import UserError
from simbench.loop.resolve import resolve_loop
from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid, Group
from simbench.scenarios.grid import load_grid
from simbench.scenarios.toml import read_toml

# groups that are settled by simulating their twin; one of every block at least
_GROUPS_SETTLED = 24


def check_grid(path: str | Path) -> Contract:
    """Check a grid file against its contract.

    Notes
    -----
    Every group is built; some, and one of every block, are settled as a run would. Not
    checked, as it needs the whole run: that 45 to 55 % of the scenarios cycle, and that settings
    alone do not predict the label (`make leak`).

    Examples
    --------
    >>> from simbench.scenarios import grid
    >>> check_grid(Path(grid.__file__).parent / "grids" / "smoke.toml").broken
    ()
    """
    path = Path(path)
    read_toml(path)
    try:
        grid = load_grid(path)
        refuse_wrong_parts(grid)  # as a run does
        groups = list(grid.groups())
    except (SpecError, UserError) as error:
        return Contract("grid", path.stem, (str(error),))
    broken: list[str | tuple[str, str]] = []
    if not grid.title.strip():
        broken.append("title is empty")
    if groups[-1] != grid.group(len(groups) - 1):
        broken.append("is not deterministic: a group built twice is two groups")
    return Contract("grid", path.stem, each_once([*broken, *_scenarios(grid, groups)]))


def _scenarios(grid: Grid, groups: list[Group]) -> Iterator[str | tuple[str, str]]:
    # in a plain grid every draft is its scenario; in a ruled one the first of each block stand for
    # the rest
    count = len(groups)
    chosen = range(count)
    if grid.content.loop is None:
        spread = (i * count // _GROUPS_SETTLED for i in range(_GROUPS_SETTLED) if count)
        chosen = sorted({*grid.samples(), *spread})
    ids: dict[str, str] = {}
    for i in chosen:
        faults, scenarios = _answer(lambda i=i: resolve(groups[i]))
        yield from ((fault, f"group {i}") for fault in faults)
        for scenario in scenarios or ():
            place = f"group {i}, member {scenario.tags.get('member')}"
            if scenario.id in ids:
                yield f"{place} is the same scenario as {ids[scenario.id]}"
            ids[scenario.id] = place
            faults, _ = _answer(
                lambda scenario=scenario: resolve_loop(scenario.loop, scenario.seed)
            )
            yield from ((fault, place) for fault in faults)


def _answer(work: Callable[[], Any]) -> tuple[list[str], Any]:
    """Return why a call gives no answer, and the answer."""
    answer = call_guarded(work)
    return answer.faults or ([str(answer.refusal)] if answer.refusal else []), answer.value

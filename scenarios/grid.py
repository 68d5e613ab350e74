"""Grids by name, from a file or from a table, with what is set from outside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from simbench.scenarios.cell import RATIOS, SETTINGS, Rules
from simbench.scenarios.columns import with_columns
from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid_check import MOST_CELLS, refuse_mistakes
from simbench.scenarios.grid_file import GRID_KEYS, GridFile, is_of_loop
from simbench.scenarios.packaged import grid_names, packaged_file, packaged_table
from simbench.scenarios.plant import Value
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import read_toml
from simbench.scenarios.toml_table import checked

_MOST_VALUES = 10_000  # of one axis


def is_grid(source: str | Path) -> bool:
    """Return whether a name, a file or a folder is a grid, and no loop file.

    >>> is_grid("ci"), is_grid("loop.toml")
    (True, False)
    """
    if str(source) in grid_names() or Path(source).is_dir():
        return True
    path = Path(source)
    if path.suffix != ".toml":
        return not path.exists()  # the sentence about an unknown grid names the known ones
    return path.is_file() and not {"loop", "block"}.isdisjoint(read_toml(path))


def load_grid(
    name: str | Path,
    sets: Mapping[str, Value] | None = None,
    axes: Mapping[str, Sequence[Value]] | None = None,
    most_cells: int = MOST_CELLS,
) -> Grid:
    """Read a grid by name or from a file; one with more cells is refused."""
    # A grid of the package, as it is or with changes
    if str(name) in grid_names():
        grid = packaged_grid(str(name))
        if not (sets or axes):
            return grid
        if grid.frozen:
            key, value = next(iter({**(sets or {}), **(axes or {})}.items()))
            raise SpecError(
                f"{name}: {key} = {value}: its scenarios stand as they are, and only --n, which"
                " takes some of them, is allowed"
            )
        label = str(name)
        table = packaged_table(str(name))

    # A file, with the columns that its loop names
    elif Path(name).suffix == ".toml" or Path(name).exists():
        label = Path(name).stem
        table = read_toml(name)
        if isinstance(table.get("loop"), dict):
            table["loop"] = with_columns(table["loop"], Path(name).parent, str(name))
    else:
        raise SpecError(
            f"unknown grid {str(name)!r}: {suggestion(str(name), grid_names())}; a TOML file or the"
            " folder of a run is a grid, too"
        )

    # Errors of the package's own grids are about what was asked of them
    try:
        return make_grid(table, label, sets, axes, most_cells)
    except SpecError as error:
        if label == str(name):  # one of the house: what was asked of it is wrong
            raise SpecError(
                f"{error}; for example --set repeats=2, --axis noise_ratio=0.1,0.3"
            ) from None

        # Errors of a file that has no block and no loop show the smallest grids
        if {"block", "loop"} & set(table):
            raise
        raise SpecError(
            f"{error}; the smallest grids that work: {SMALLEST_LOOP}, or {SMALLEST_BLOCK}"
        ) from None


@cache
def packaged_grid(name: str) -> Grid:
    """Return a grid of the package as it stands; no cell of it is tried, which tests do."""
    return Grid(name, packaged_file(name))


SMALLEST_LOOP = (
    'loop = { plant = { type = "foptd", K = 1, T = 10 }, controller = { type = "PI", Kc = 1, Ti ='
    ' 10 }, valve = { model = "choudhury", S = 5, J = 2 }, sampling = { Ts = 1 } }'
)
SMALLEST_BLOCK = (
    'block = [{ name = "own", draw = { K = 1, T = 10, S = 5, samples_per_period = 30, periods = 20'
    ' }, axes = { Td_over_T = [0.2], S_over_2J = [1.0] }, member = [{ name = "sticky", valve ='
    ' "choudhury" }] }]'
)


def make_grid(
    table: dict[str, Any],
    name: str = "grid",
    sets: Mapping[str, Value] | None = None,
    axes: Mapping[str, Sequence[Value]] | None = None,
    most_cells: int = MOST_CELLS,
) -> Grid:
    """Build a grid from the table that its TOML file would give; arguments and errors as
    `load_grid`.
    """
    table = dict(table)
    overrides: dict[str, Value] = {}
    changed: dict[str, tuple[Value, ...]] = {}
    for key, values in (axes or {}).items():
        changed[key] = tuple(values)
    for key, value in (sets or {}).items():
        if key in GRID_KEYS:
            if isinstance(value, float) and value.is_integer():
                table[key] = int(value)
            else:
                table[key] = value
        elif key in SETTINGS and "block" in table:
            changed[key] = (value,)
        elif "." in key or "loop" in table:
            overrides[key] = value
        else:
            raise SpecError(
                f"{name}: cannot set {key!r}, {suggestion(key, GRID_KEYS + tuple(SETTINGS))}"
            )
    if isinstance(table.get("block"), list):
        blocks = table["block"]
    else:
        blocks = []
    for axes_of in [part.get("axes") for part in (table, *blocks) if isinstance(part, dict)]:
        for key, values in axes_of.items() if isinstance(axes_of, dict) else ():
            if isinstance(values, list) and len(values) > _MOST_VALUES:
                raise SpecError(
                    f"{name}: axis {key!r} has {len(values)} values; at most {_MOST_VALUES} are"
                    " allowed"
                )
    content = checked(GridFile, table, name)

    # an axis replaced from outside may leave a member no value; a file that allows none is mistaken
    for block, member, key in [
        (b, m, k) for b in content.block for m in b.member for k, v in m.where.items() if not v
    ]:
        raise SpecError(
            f"{name}: block {block.name!r}: member {member.name!r}: where {key} has no value; one"
            " is needed"
        )
    if changed:
        content = _with_axes(content, changed, name)
    for key in overrides:
        if key not in (Rules.FIELDS + RATIOS) and (
            key.partition(".")[0] not in Loop.model_fields or "." not in key
        ):
            raise SpecError(
                f"{name}: cannot set {key!r}, {suggestion(key, GRID_KEYS + tuple(SETTINGS))}"
            )
    grid = Grid(name, content, overrides)
    refuse_mistakes(grid, most_cells)
    untouched = not changed and not overrides
    per_repeat = content.expected and content.expected * content.repeats // int(
        table.get("repeats", 1)
    )
    if (
        untouched
        and content.expected is not None
        and "repeats" not in (sets or {})
        and len(grid) != per_repeat
    ):
        said = f"{len(grid)} scenarios, but expected = {content.expected}"
        raise SpecError(f"{name}: {said}; the number it has is needed, or no such key")
    return grid


def _with_axes(content: GridFile, axes: dict[str, tuple[Value, ...]], name: str) -> GridFile:
    if content.loop is not None:
        return content.model_copy(update={"axes": {**content.axes, **axes}})
    for key in axes:
        if key not in SETTINGS and not is_of_loop(key):
            raise SpecError(f"{name}: unknown axis {key!r}, {suggestion(key, SETTINGS)}")

    # an axis that some blocks have is changed there; one that none has is added to all
    known = set(content.draw)
    for block in content.block:
        known |= {*block.axes, *block.draw}
    blocks = []
    for block in content.block:
        # Td/T has no meaning on an integrating block, nor Td/Ti on the other; another process needs
        # its own of the two
        processes = axes.get("process", block.axes.get("process", (block.process,)))
        needed = set()
        for process in processes:
            needed.add("Td_over_Ti" if process == "integrating" else "Td_over_T")
        alien = {"Td_over_T", "Td_over_Ti"} - needed
        own = {*block.axes, *block.draw, *content.draw, *needed}
        fitting = {}
        for k, v in axes.items():
            if k not in alien and (k in own or k not in known):
                fitting[k] = v
        members = []
        for m in block.member:
            members.append(m.model_copy(update={"where": _narrow_axes(m.where, fitting)}))
        changes = {"axes": {**block.axes, **fitting}, "member": tuple(members)}
        blocks.append(block.model_copy(update=changes))
    return content.model_copy(update={"block": tuple(blocks)})


def _narrow_axes(
    where: dict[str, tuple[Value, ...]], axes: Mapping[str, tuple[Value, ...]]
) -> dict[str, tuple[Value, ...]]:
    # a member kept to a few values of an axis stays with those that the new axis still has
    narrowed = {}
    for key, allowed in where.items():
        narrowed[key] = tuple(v for v in allowed if key not in axes or v in axes[key])
    return narrowed

"""Grids: a TOML file becomes groups of scenario drafts, one group at a time; what needs a
simulation stays a rule.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_serializer, model_validator

from simbench.scenarios.cell import (
    RATIOS,
    SETTINGS,
    Draft,
    Rules,
    Scaled,
    cell_group,
    loop_axes,
    scenario_id,
    with_ratios,
)
from simbench.scenarios.columns import with_columns
from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.grid_check import MOST_CELLS, refuse_mistakes
from simbench.scenarios.spec import (
    Loop,
    Real,
    Value,
    Whole,
    _Table,
    checked,
    content_hash,
    read_toml,
)

_Range = Real | tuple[Real, Real]
_Names = str | tuple[str, ...]
_Scale = Literal["S", "J", "period", "pv"]
_GRID_KEYS = ("seed", "repeats")
# they change no scenario
_UNHASHED = ("title", "source", "author", "date", "version", "expected", "told_from_recorded")
_MOST_REPEATS = 1_000_000
_MOST_VALUES = 10_000  # of one axis


class Disturbance(_Table):
    """A load by its size against the sticky twin: amplitude in its PV std (at "input": its S),
    times in its periods.
    """

    type: str
    at: str = "output"
    amplitude: _Range
    period: _Range
    parameters: dict[str, _Range] = Field(default_factory=dict)


class More(_Table):
    """Parameters of a valve or an effect beyond the cell's (S, J): drawn, then multiplied by what
    `scale` names.

    S, J: of the cell (% of travel); period, pv: of the sticky twin's cycle (s), PV std of it (PV
    units).
    """

    name: str | None = None
    parameters: dict[str, _Range | _Names] = Field(default_factory=dict)
    scale: dict[str, _Scale] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_scale(self) -> Self:
        for key in self.scale:
            if key not in self.parameters:
                raise ValueError(
                    f"scale asks for {key!r}, which is none of the parameters,"
                    f" {suggestion(key, self.parameters)}"
                )
        return self

    def drawn(self, name: str, rng: np.random.Generator) -> Scaled:
        """Return the part with its parameters drawn; `name` is that of the table."""
        values = {key: draw(value, rng) for key, value in sorted(self.parameters.items())}
        return Scaled(self.name or name, values, dict(self.scale))


def _without_defaults(*keys: str) -> Any:
    """Return how a table is written: keys that are younger than the first grids only where they are
    used, as the others keep their hash.
    """

    def written(self: Any, handler: Any) -> dict[str, Any]:
        default = {key: type(self).model_fields[key].default for key in keys}
        return {k: v for k, v in handler(self).items() if k not in default or v != default[k]}

    return written


class Member(_Table):
    """One of the scenarios that share a cell: a valve, and what else sets it apart from its
    siblings.

    `echo` makes a healthy loop move as a sticky one of its cell does, so that neither amplitude nor
    period nor rhythm tells them apart: plant, controller, loads, noise and numbers are those of the
    sibling `of` (by default the first sticky member), the seed is another, and a load of type
    `echo` is added. A loop whose sibling does not cycle with this seed is left out and counted.
    """

    name: str
    valve: _Names
    tuning: _Names | None = None
    disturbance: _Names | None = None
    echo: _Names | None = None
    of: str | None = None
    where: dict[str, tuple[Value, ...]] = Field(default_factory=dict)

    _written = model_serializer(mode="wrap")(_without_defaults("echo", "of"))


class Block(_Table):
    """A product of axes; `draw` ranges are drawn evenly in logarithm, once per group.

    Where `ranked` is false no ranking counts its loops: false positives by cause show them.
    """

    name: str
    says: str = ""
    process: str = "foptd"
    controller: str = "PI"
    axes: dict[str, tuple[Value, ...]] = Field(default_factory=dict)
    draw: dict[str, _Range | _Names] = Field(default_factory=dict)
    member: tuple[Member, ...] = ()
    ranked: bool = True

    _written = model_serializer(mode="wrap")(_without_defaults("ranked"))


class GridFile(_Table):
    """What a grid file holds: blocks of ruled cells, or one whole loop with axes of dotted keys."""

    title: str = "own grid"
    source: str = "own"
    author: str = ""
    date: str = ""
    version: Annotated[Whole, Field(ge=1)] = 1
    expected: int | None = None
    # AUC with which a classifier tells its loops from recorded ones (results/grid_gaps.txt)
    told_from_recorded: Annotated[Real, Field(ge=0.0, le=1.0)] | None = None
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0
    repeats: Annotated[Whole, Field(ge=1, le=_MOST_REPEATS)] = 1
    draw: dict[str, _Range | _Names] = Field(default_factory=dict)
    disturbances: dict[str, Disturbance] = Field(default_factory=dict)
    valves: dict[str, More] = Field(default_factory=dict)
    effects: dict[str, More] = Field(default_factory=dict)
    block: tuple[Block, ...] = ()
    loop: dict[str, Any] | None = None
    axes: dict[str, tuple[Value, ...]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if bool(self.block) == (self.loop is not None):
            raise ValueError("a grid has either [[block]] tables or one [loop] with [axes]")
        for block in self.block:
            for key in (*self.draw, *block.axes, *block.draw):
                if key not in SETTINGS and not _of_loop(key):
                    raise ValueError(
                        f"block {block.name!r}: unknown axis {key!r}, {suggestion(key, SETTINGS)}"
                    )
            for member in block.member:
                for key in member.where:
                    if key not in block.axes:
                        none = f"where asks for {key!r}, which is none of its axes"
                        raise ValueError(
                            f"block {block.name!r}: {none}, {suggestion(key, block.axes)}"
                        )
        return self


@dataclass(frozen=True)
class Group:
    """The scenarios of one cell and one repeat.

    They share plant, sampling, noise, set point and seed; only an echo has another seed.
    """

    index: int  # place in the grid
    # the cell's sticky loop without noise and disturbance; its sampling is a first guess
    twin: Loop
    rules: Rules  # what is settled by running the twin
    drafts: tuple[Draft, ...]  # the members


@dataclass(frozen=True)
class Grid:
    """A grid, ready to be expanded group by group; nothing is kept in memory."""

    name: str  # its name or file
    content: GridFile  # the checked file, overrides applied
    overrides: dict[str, Value] = field(default_factory=dict)  # dotted loop keys set from outside

    @property
    def title(self) -> str:
        """What the grid is for, in one line."""
        return self.content.title

    @property
    def source(self) -> str:
        """Where its design comes from."""
        return self.content.source

    @property
    def hash(self) -> str:
        """16 hex digits that change with anything that changes the list of scenarios."""
        kept = {k: v for k, v in self.content.model_dump().items() if k not in _UNHASHED}
        return content_hash({"content": kept, "overrides": self.overrides})

    @property
    def cells_hash(self) -> str:
        """16 hex digits of what the grid asks, whatever its seed, repeats and name."""
        without = (*_UNHASHED, *_GRID_KEYS)
        kept = {k: v for k, v in self.content.model_dump().items() if k not in without}
        return content_hash({"content": kept, "overrides": self.overrides})

    @property
    def of_package(self) -> bool:
        """Whether it asks what a grid of the package of this name asks, whatever its seed."""
        return self.name in grid_names() and self.cells_hash == packaged_grid(self.name).cells_hash

    @property
    def frozen(self) -> bool:
        """Whether its scenarios stand in a table alone: it has no member from which others could be
        drawn.
        """
        return bool(self.content.block) and not any(b.member for b in self.content.block)

    @cached_property
    def benchmark(self) -> str:
        """Name and version; of a grid that is not one of the package, with a hash of its cells."""
        named = f"{self.name}-{self.content.version}"
        return named if self.of_package else f"{named} {self.cells_hash}"

    @cached_property
    def _cells(self) -> list[tuple[int, int]]:
        # (first cell, number of cells) of each block
        sizes = [math.prod(len(v) for v in axes.values()) for axes in self._axes]
        return [(sum(sizes[:i]), size) for i, size in enumerate(sizes)]

    @property
    def _axes(self) -> list[dict[str, tuple[Value, ...]]]:
        return [b.axes for b in self.content.block] if self.content.block else [self.content.axes]

    @property
    def cells(self) -> int:
        """Number of cells: combinations of axis values, over all blocks."""
        return sum(size for _, size in self._cells)

    @property
    def group_count(self) -> int:
        """Number of groups: cells times repeats."""
        return self.cells * self.content.repeats

    @cached_property
    def _members(self) -> int:
        if not self.content.block:
            return self.cells
        # by counting what each member takes of each axis: a grid of a million cells is not listed
        # for it
        return sum(
            math.prod(
                sum(v in member.where.get(key, values) for v in values)
                for key, values in block.axes.items()
            )
            for block in self.content.block
            for member in block.member
        )

    @cached_property
    def _sizes(self) -> list[int]:
        return [len(self._present(*self._place(cell))) for cell in range(self.cells)]

    def __len__(self) -> int:
        """Number of scenarios."""
        if self.frozen:
            return self.content.expected or 0
        return self._members * self.content.repeats

    def samples(self, most: int = 200) -> list[int]:
        """Return a few groups that show every kind of cell: the first of each block, or most cells
        of a single loop.
        """
        return (
            [first for first, _ in self._cells]
            if self.content.block
            else list(range(min(self.cells, most)))
        )

    def groups(self, start: int = 0, stop: int | None = None) -> Iterator[Group]:
        """Yield groups start..stop-1; repeats come last, so more of them only append."""
        for index in range(start, self.group_count if stop is None else stop):
            yield self.group(index)

    def size(self, index: int) -> int:
        """Return the number of scenarios of a group without building it."""
        return self._sizes[index % len(self._sizes)]

    def cell(self, number: int) -> tuple[str, dict[str, Value], tuple[str, ...]]:
        """Return a cell's block, its value of each axis and the names of its members, without
        building it.
        """
        block, values = self._place(number)
        name = self.content.block[block].name if self.content.block else "loop"
        return name, values, tuple(m.name for m in self._present(block, values))

    def group(self, index: int) -> Group:
        """Build one group."""
        repeat, cell = divmod(index, self.cells)
        number, values = self._place(cell)
        # cells that differ in the disturbance alone share the plant, so that they can be compared;
        # where echoes make the comparison, more plants are better
        members = self._present(number, values)
        without = "" if any(m.echo is not None for m in members) else "disturbance"
        shared = np.random.default_rng(
            [self.content.seed, repeat, number, *self._without(number, values, without)]
        )
        rng = np.random.default_rng([self.content.seed, repeat, number, cell, 1])
        tags: dict[str, float | int | str | None] = {
            "grid": self.name,
            "benchmark": self.benchmark,
            "cell": cell,
            "repeat": repeat,
        }
        if self.content.loop is not None:
            return self._draw_loop(index, values, rng, tags)
        block = self.content.block[number]
        settings: dict[str, Any] = {"process": block.process, "controller": block.controller}
        ranges = {**self.content.draw, **block.draw}
        # every setting is drawn, also those an axis replaces: one axis more must not shift the
        # other draws
        settings.update({key: draw(ranges[key], shared) for key in sorted(ranges)})
        # the record's own numbers cell by cell: shared, they would let a classifier know cells
        # again
        each = np.random.default_rng([self.content.seed, repeat, number, cell, 2])
        settings.update({key: draw(ranges[key], each) for key in Rules.FIELDS if key in ranges})
        settings.update(values)
        settings["step"] = float(settings.get("step", 0.0)) * (
            1.0 if shared.random() < 0.5 else -1.0
        )
        # what stands in the record beside valve and load is shared as well: it must not tell
        # siblings apart
        settings["effects"] = self._effects(settings.get("effect", "none"), shared)
        settings["sp_moves"] = _moves(settings, shared)
        settings["seed"] = int(rng.integers(2**63))
        made: list[tuple[str, dict[str, Any], tuple[dict[str, Any], ...]]] = []
        for member in members:
            own = dict(settings, valve=_pick(member.valve, rng))
            for key in ("tuning", "disturbance"):
                if getattr(member, key) is not None:
                    own[key] = _pick(getattr(member, key), rng)
            loads = self._disturbance(own.get("disturbance", "none"), rng)
            name = str(own["valve"])
            own["valve"] = self.content.valves.get(name, More()).drawn(name, rng)
            if member.echo is not None:
                present = [name for name, one, _ in made if "echo" not in one]
                of = member.of or next(iter(present), None)
                if of not in present:
                    raise SpecError(
                        f"{self.name}: block {block.name!r}: member {member.name!r}: echo has no"
                        f" sibling {of or ''} in cell {cell}; one that is there too is needed"
                    )
                own.update(echo=_pick(member.echo, rng), of=of, seed=int(rng.integers(2**63)))
            made.append((member.name, own, loads))
        tags.update(block=block.name, ranked=float(block.ranked))
        # keys of the loop file, as axis or draw: they have the last word, but for what was set from
        # outside
        keys = {key: settings.pop(key) for key in list(settings) if _of_loop(key)}
        overrides = {**keys, **self.overrides}
        tags.update({key: _tag_of(value) for key, value in keys.items()})
        twin, rules, drafts = cell_group(
            settings, made, tags, overrides, f"{self.name}, block {block.name!r}"
        )
        return Group(index, twin, rules, drafts)

    def _draw_loop(
        self, index: int, values: Mapping[str, Value], rng: np.random.Generator, tags: dict
    ) -> Group:
        assert self.content.loop is not None
        loop = Loop.from_table(self.content.loop, self.name)
        rules: dict[str, Any] = {}
        settings = {**values, **self.overrides}
        for key in [key for key in settings if key in Rules.FIELDS]:
            rules[key] = settings.pop(key)
        ratios = {key: settings.pop(key) for key in RATIOS if key in settings}
        loop = loop.with_all(settings)
        # a healthy valve is sampled as its sticky twin
        moving = {key: value for key, value in ratios.items() if (key, value) != ("S_over_2J", 0)}
        sticky = with_ratios(loop, moving, self.name)
        loop = with_ratios(loop, ratios, self.name)
        seed = int(rng.integers(2**63))
        told = {key: _tag_of(value) for key, value in values.items()}
        tags = {**tags, "block": "loop", "member": "loop", **loop_axes(loop), **told}
        twin = sticky.model_copy(update={"noise": type(loop.noise)(), "disturbance": ()})
        draft = Draft(loop, tags, Rules(**rules), seed, scenario_id(tags, seed))
        return Group(index, twin, Rules(**rules), (draft,))

    def _disturbance(self, name: Value, rng: np.random.Generator) -> tuple[dict[str, Any], ...]:
        if name == "none":
            return ()
        d = self._part_named("disturbance", self.content.disturbances, name)
        more = {key: draw(value, rng) for key, value in sorted(d.parameters.items())}
        return (
            {
                "type": d.type,
                "at": d.at,
                "amplitude": draw(d.amplitude, rng),
                "period": draw(d.period, rng),
                **more,
            },
        )

    def _effects(self, name: Value, rng: np.random.Generator) -> tuple[Scaled, ...]:
        return (
            ()
            if name == "none"
            else (self._part_named("effect", self.content.effects, name).drawn(str(name), rng),)
        )

    def _part_named(self, kind: str, parts: Mapping[str, Any], name: Value) -> Any:
        if name not in parts:
            raise SpecError(
                f"{self.name}: {kind} {name!r} is unknown,"
                f" {suggestion(str(name), ('none', *parts))}"
            )
        return parts[str(name)]

    def _place(self, cell: int) -> tuple[int, dict[str, Value]]:
        number = next(i for i, (first, size) in enumerate(self._cells) if cell < first + size)
        index = cell - self._cells[number][0]
        values = {}
        for key, choices in reversed(list(self._axes[number].items())):
            index, place = divmod(index, len(choices))
            values[key] = choices[place]
        return number, dict(reversed(values.items()))

    def _without(self, number: int, values: Mapping[str, Value], left_out: str) -> list[int]:
        # a key of the loop file that has one value is no choice: it shifts no draw
        axes = {
            key: choices
            for key, choices in self._axes[number].items()
            if not _of_loop(key) or len(choices) > 1
        }
        return [choices.index(values[key]) for key, choices in axes.items() if key != left_out]

    def _present(self, number: int, values: Mapping[str, Value]) -> Sequence[Member]:
        if not self.content.block:
            return [Member(name="loop", valve="")]
        members = self.content.block[number].member
        return [
            m for m in members if all(values[key] in allowed for key, allowed in m.where.items())
        ]


def draw(allowed: _Range | _Names, rng: np.random.Generator) -> float | str:
    """Return a fixed value as it is, one of several names, or a value drawn evenly in logarithm
    from (lo, hi).
    """
    if not isinstance(allowed, tuple):
        return allowed
    if isinstance(allowed[0], str):
        return _pick(allowed, rng)
    lo, hi = allowed
    return math.exp(rng.uniform(math.log(lo), math.log(hi)))


def _pick(names: _Names, rng: np.random.Generator) -> str:
    """Return one of several names, each as likely."""
    return names if isinstance(names, str) else names[int(rng.integers(len(names)))]


def _of_loop(key: str) -> bool:
    """Return whether an axis is a key of the loop file, or one of its sections whole, and none of a
    cell's settings.
    """
    return key not in SETTINGS and ("." in key or key in Loop.model_fields)


def _tag_of(value: Any) -> float | int | str:
    """Return an axis value as a tag: a table by the name of its part, or written out like a
    list.
    """
    if not isinstance(value, (dict, list, tuple)):
        return value
    names = [
        str(value[k]) for k in ("model", "type", "name") if isinstance(value, dict) and k in value
    ]
    more = (
        {k: v for k, v in value.items() if k not in ("model", "type", "name")} if names else value
    )
    return " ".join(
        [*names, json.dumps(more, separators=(",", ":"))] if more or not names else names
    )


def _moves(
    settings: Mapping[str, Any], rng: np.random.Generator
) -> tuple[tuple[float, float], ...]:
    """Draw (time in periods, level in PV std) of the set-point steps, spread evenly over the
    record.
    """
    count = round(float(settings.get("moves", 0.0)))
    if count == 0:
        return ()
    times = np.sort(rng.uniform(0.0, float(settings["periods"]), count))
    return tuple(
        zip(
            times.tolist(),
            (float(settings["move"]) * rng.uniform(-1.0, 1.0, count)).tolist(),
            strict=True,
        )
    )


def grid_names() -> list[str]:
    """Return the names of the grids that come with the package."""
    folder = files("simbench.scenarios") / "grids"
    return sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml"))


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
        table = _packaged_table(str(name))
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
    try:
        return make_grid(table, label, sets, axes, most_cells)
    except SpecError as error:
        if label == str(name):  # one of the house: what was asked of it is wrong
            raise SpecError(
                f"{error}; for example --set repeats=2, --axis noise_ratio=0.1,0.3"
            ) from None
        if {"block", "loop"} & set(table):
            raise
        raise SpecError(
            f"{error}; the smallest grids that work: {SMALLEST_LOOP}, or {SMALLEST_BLOCK}"
        ) from None


@cache
def packaged_grid(name: str) -> Grid:
    """Return a grid of the package as it stands; no cell of it is tried, which tests do."""
    return Grid(name, checked(GridFile, _packaged_table(name), name))


def _packaged_table(name: str) -> dict[str, Any]:
    return read_toml(Path(str(files("simbench.scenarios") / "grids" / f"{name}.toml")))


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
    changed: dict[str, tuple[Value, ...]] = {
        key: tuple(values) for key, values in (axes or {}).items()
    }
    for key, value in (sets or {}).items():
        if key in _GRID_KEYS:
            table[key] = int(value) if isinstance(value, float) and value.is_integer() else value
        elif key in SETTINGS and "block" in table:
            changed[key] = (value,)
        elif "." in key or "loop" in table:
            overrides[key] = value
        else:
            raise SpecError(
                f"{name}: cannot set {key!r}, {suggestion(key, (*_GRID_KEYS, *SETTINGS))}"
            )
    blocks = table["block"] if isinstance(table.get("block"), list) else []
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
        if key not in (*Rules.FIELDS, *RATIOS) and (
            key.partition(".")[0] not in Loop.model_fields or "." not in key
        ):
            raise SpecError(
                f"{name}: cannot set {key!r}, {suggestion(key, (*_GRID_KEYS, *SETTINGS))}"
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
        if key not in SETTINGS and not _of_loop(key):
            raise SpecError(f"{name}: unknown axis {key!r}, {suggestion(key, SETTINGS)}")
    # an axis that some blocks have is changed there; one that none has is added to all
    known = {key for block in content.block for key in (*block.axes, *block.draw, *content.draw)}
    blocks = []
    for block in content.block:
        # Td/T has no meaning on an integrating block, nor Td/Ti on the other; another process needs
        # its own of the two
        processes = axes.get("process", block.axes.get("process", (block.process,)))
        needed = {
            "Td_over_Ti" if process == "integrating" else "Td_over_T" for process in processes
        }
        alien = {"Td_over_T", "Td_over_Ti"} - needed
        own = {*block.axes, *block.draw, *content.draw, *needed}
        fitting = {k: v for k, v in axes.items() if k not in alien and (k in own or k not in known)}
        members = tuple(
            m.model_copy(update={"where": _narrow_axes(m.where, fitting)}) for m in block.member
        )
        blocks.append(
            block.model_copy(update={"axes": {**block.axes, **fitting}, "member": members})
        )
    return content.model_copy(update={"block": tuple(blocks)})


def _narrow_axes(
    where: dict[str, tuple[Value, ...]], axes: Mapping[str, tuple[Value, ...]]
) -> dict[str, tuple[Value, ...]]:
    # a member kept to a few values of an axis stays with those that the new axis still has
    return {
        key: tuple(v for v in allowed if key not in axes or v in axes[key])
        for key, allowed in where.items()
    }


def chunks(grid: Grid) -> Iterator[tuple[int, int]]:
    """Yield (first group, last group + 1) of pieces of up to 80 scenarios, 1000 of a large grid;
    they depend on it alone.
    """
    # a small grid is cut finer, so that several workers find work; a large one coarser: every piece
    # costs whoever hands it out
    most = min(80, max(len(grid) // 16, 4)) if len(grid) <= 20_000 else min(len(grid) // 125, 1000)
    start = 0
    held = 0
    for index in range(grid.group_count):
        size = grid.size(index)
        if held and held + size > most:
            yield start, index
            start = index
            held = 0
        held += size
    if held:
        yield start, grid.group_count

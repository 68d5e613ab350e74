"""Grids: a TOML file becomes groups of scenario drafts, one group at a time; what needs a
simulation stays a rule.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from simbench.scenarios.cell import (
    RATIOS,
    Draft,
    Rules,
    Scaled,
    cell_group,
    loop_axes,
    scenario_id,
    with_ratios,
)
from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.grid_file import (
    GRID_KEYS,
    UNHASHED,
    GridFile,
    Member,
    More,
    draw,
    is_of_loop,
    pick,
)
from simbench.scenarios.packaged import grid_names, packaged_file
from simbench.scenarios.plant import Value
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import content_hash


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
        kept = {}
        for k, v in self.content.model_dump().items():
            if k not in UNHASHED:
                kept[k] = v
        return content_hash({"content": kept, "overrides": self.overrides})

    @property
    def cells_hash(self) -> str:
        """16 hex digits of what the grid asks, whatever its seed, repeats and name."""
        without = UNHASHED + GRID_KEYS
        kept = {}
        for k, v in self.content.model_dump().items():
            if k not in without:
                kept[k] = v
        return content_hash({"content": kept, "overrides": self.overrides})

    @property
    def of_package(self) -> bool:
        """Whether it asks what a grid of the package of this name asks, whatever its seed."""
        if self.name not in grid_names():
            return False
        return self.cells_hash == Grid(self.name, packaged_file(self.name)).cells_hash

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
        if self.of_package:
            return named
        return f"{named} {self.cells_hash}"

    @cached_property
    def _cells_of_blocks(self) -> list[tuple[int, int]]:
        # (first cell, number of cells) of each block
        sizes = [math.prod(len(v) for v in axes.values()) for axes in self._axes_of_blocks]
        return [(sum(sizes[:i]), size) for i, size in enumerate(sizes)]

    @property
    def _axes_of_blocks(self) -> list[dict[str, tuple[Value, ...]]]:
        if self.content.block:
            return [b.axes for b in self.content.block]
        return [self.content.axes]

    @property
    def cells(self) -> int:
        """Number of cells: combinations of axis values, over all blocks."""
        return sum(size for _, size in self._cells_of_blocks)

    @property
    def group_count(self) -> int:
        """Number of groups: cells times repeats."""
        return self.cells * self.content.repeats

    @cached_property
    def _count_members(self) -> int:
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
    def _count_present(self) -> list[int]:
        return [
            len(self._present_members(*self._place_of_cell(cell))) for cell in range(self.cells)
        ]

    def __len__(self) -> int:
        """Number of scenarios."""
        if self.frozen:
            return self.content.expected or 0
        return self._count_members * self.content.repeats

    def samples(self, most: int = 200) -> list[int]:
        """Return a few groups that show every kind of cell: the first of each block, or most cells
        of a single loop.
        """
        if self.content.block:
            return [first for first, _ in self._cells_of_blocks]
        return list(range(min(self.cells, most)))

    def groups(self, start: int = 0, stop: int | None = None) -> Iterator[Group]:
        """Yield groups start..stop-1; repeats come last, so more of them only append."""
        for index in range(start, self.group_count if stop is None else stop):
            yield self.group(index)

    def size(self, index: int) -> int:
        """Return the number of scenarios of a group without building it."""
        return self._count_present[index % len(self._count_present)]

    def cell(self, number: int) -> tuple[str, dict[str, Value], tuple[str, ...]]:
        """Return a cell's block, its value of each axis and the names of its members, without
        building it.
        """
        block, values = self._place_of_cell(number)
        if self.content.block:
            name = self.content.block[block].name
        else:
            name = "loop"
        return name, values, tuple(m.name for m in self._present_members(block, values))

    def group(self, index: int) -> Group:
        """Build one group."""
        repeat, cell = divmod(index, self.cells)
        number, values = self._place_of_cell(cell)

        # cells that differ in the disturbance alone share the plant, so that they can be compared;
        # where echoes make the comparison, more plants are better
        members = self._present_members(number, values)
        without = "" if any(m.echo is not None for m in members) else "disturbance"
        shared = np.random.default_rng(
            [self.content.seed, repeat, number] + self._numbers_without(number, values, without)
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
        settings["effects"] = self._draw_effects(settings.get("effect", "none"), shared)
        settings["sp_moves"] = _draw_moves(settings, shared)
        settings["seed"] = int(rng.integers(2**63))
        made: list[tuple[str, dict[str, Any], tuple[dict[str, Any], ...]]] = []
        for member in members:
            own = dict(settings, valve=pick(member.valve, rng))
            for key in ("tuning", "disturbance"):
                if getattr(member, key) is not None:
                    own[key] = pick(getattr(member, key), rng)
            loads = self._draw_disturbance(own.get("disturbance", "none"), rng)
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
                own.update(echo=pick(member.echo, rng), of=of, seed=int(rng.integers(2**63)))
            made.append((member.name, own, loads))
        tags.update(block=block.name, ranked=float(block.ranked))

        # keys of the loop file, as axis or draw: they have the last word, but for what was set from
        # outside
        keys = {}
        for key in list(settings):
            if is_of_loop(key):
                keys[key] = settings.pop(key)
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
        ratios = {}
        for key in RATIOS:
            if key in settings:
                ratios[key] = settings.pop(key)
        loop = loop.with_all(settings)

        # a healthy valve is sampled as its sticky twin
        moving = {}
        for key, value in ratios.items():
            if (key, value) != ("S_over_2J", 0):
                moving[key] = value
        sticky = with_ratios(loop, moving, self.name)
        loop = with_ratios(loop, ratios, self.name)
        seed = int(rng.integers(2**63))
        told = {}
        for key, value in values.items():
            told[key] = _tag_of(value)
        tags = {**tags, "block": "loop", "member": "loop", **loop_axes(loop), **told}
        twin = sticky.model_copy(update={"noise": type(loop.noise)(), "disturbance": ()})
        draft = Draft(loop, tags, Rules(**rules), seed, scenario_id(tags, seed))
        return Group(index, twin, Rules(**rules), (draft,))

    def _draw_disturbance(
        self, name: Value, rng: np.random.Generator
    ) -> tuple[dict[str, Any], ...]:
        # A disturbance's numbers are drawn, its parameters in the order of their names
        if name == "none":
            return ()
        d = self._part_named("disturbance", self.content.disturbances, name)
        more = {}
        for key, value in sorted(d.parameters.items()):
            more[key] = draw(value, rng)

        # A table as [[disturbance]] has it
        return (
            {
                "type": d.type,
                "at": d.at,
                "amplitude": draw(d.amplitude, rng),
                "period": draw(d.period, rng),
                **more,
            },
        )

    def _draw_effects(self, name: Value, rng: np.random.Generator) -> tuple[Scaled, ...]:
        if name == "none":
            return ()
        return (self._part_named("effect", self.content.effects, name).drawn(str(name), rng),)

    def _part_named(self, kind: str, parts: Mapping[str, Any], name: Value) -> Any:
        if name not in parts:
            raise SpecError(
                f"{self.name}: {kind} {name!r} is unknown,"
                f" {suggestion(str(name), ('none', *parts))}"
            )
        return parts[str(name)]

    def _place_of_cell(self, cell: int) -> tuple[int, dict[str, Value]]:
        number = next(
            i for i, (first, size) in enumerate(self._cells_of_blocks) if cell < first + size
        )
        index = cell - self._cells_of_blocks[number][0]
        values = {}
        for key, choices in reversed(list(self._axes_of_blocks[number].items())):
            index, place = divmod(index, len(choices))
            values[key] = choices[place]
        return number, dict(reversed(values.items()))

    def _numbers_without(
        self, number: int, values: Mapping[str, Value], left_out: str
    ) -> list[int]:
        # a key of the loop file that has one value is no choice: it shifts no draw
        axes = {}
        for key, choices in self._axes_of_blocks[number].items():
            if not is_of_loop(key) or len(choices) > 1:
                axes[key] = choices
        return [choices.index(values[key]) for key, choices in axes.items() if key != left_out]

    def _present_members(self, number: int, values: Mapping[str, Value]) -> Sequence[Member]:
        if not self.content.block:
            return [Member(name="loop", valve="")]
        members = self.content.block[number].member
        present = []
        for m in members:
            if all(values[key] in allowed for key, allowed in m.where.items()):
                present.append(m)
        return present


def _tag_of(value: Any) -> float | int | str:
    """Return an axis value as a tag: a table by the name of its part, or written out like a
    list.
    """
    # A number or a word is its own tag
    if not isinstance(value, (dict, list, tuple)):
        return value

    # A table's name comes first, then what else it holds
    names = []
    for k in ("model", "type", "name"):
        if isinstance(value, dict) and k in value:
            names.append(str(value[k]))
    if names:
        more = {}
        for k, v in value.items():
            if k not in ("model", "type", "name"):
                more[k] = v
    else:
        more = value
    return " ".join(
        (names + [json.dumps(more, separators=(",", ":"))]) if more or not names else names
    )


def _draw_moves(
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


def chunks(grid: Grid) -> Iterator[tuple[int, int]]:
    """Yield (first group, last group + 1) of pieces of up to 80 scenarios, 1000 of a large grid;
    they depend on it alone.
    """
    # a small grid is cut finer, so that several workers find work; a large one coarser: every piece
    # costs whoever hands it out
    if len(grid) <= 20_000:
        most = min(80, max(len(grid) // 16, 4))
    else:
        most = min(len(grid) // 125, 1000)
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

"""A random sample of a grid's scenarios: itself a grid, drawn without listing the whole one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid, Group
from simbench.scenarios.grid_file import Member
from simbench.scenarios.toml import content_hash


class _Stratum(NamedTuple):
    """The scenarios of one member of one block, over all cells that have it, and all repeats."""

    member: Member
    first: int  # cell of the block
    sizes: tuple[int, ...]  # number of values of each axis
    # places of the values that the member takes, for each axis
    allowed: tuple[tuple[int, ...], ...]
    repeats: int

    @property
    def size(self) -> int:
        return math.prod(map(len, self.allowed)) * self.repeats

    def group(self, place: int) -> tuple[int, int]:
        """Return cell and repeat of one of these scenarios; repeats vary fastest, the first axis
        slowest.
        """
        place, repeat = divmod(place, self.repeats)
        cell = self.first
        stride = 1
        for size, allowed in zip(reversed(self.sizes), reversed(self.allowed), strict=True):
            place, value = divmod(place, len(allowed))
            cell = cell + stride * allowed[value]
            stride = stride * size
        return cell, repeat


@dataclass(frozen=True)
class Sample(Grid):
    """`points` scenarios of a grid, each of its scenarios as likely as any other.

    The list of all scenarios, by block, member, cell and repeat, is cut into `points` parts of
    equal size, and about one scenario is drawn from each: the sample is spread evenly over the
    axes. It is a function of the grid, its seed and `points` alone, and its scenarios are those
    that the whole grid has, with the same ids and seeds. Memory grows with `points`, not with the
    grid.
    """

    points: int = 1

    @classmethod
    def of(cls, grid: Grid, points: int) -> Sample:
        """Return a sample of a grid; SpecError where it has fewer scenarios, or less than one is
        asked for.
        """
        if not 1 <= points <= len(grid):
            raise SpecError(
                f"{grid.name}: {points} points; 1 to {len(grid)} are allowed, as it has so many"
                " scenarios"
            )
        return cls(grid.name, grid.content, grid.overrides, points)

    def __getstate__(self) -> dict[str, Any]:
        # what can be drawn again does not travel to workers
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __len__(self) -> int:
        """Number of scenarios drawn."""
        return self.points

    @cached_property
    def whole(self) -> Grid:
        """The grid it was drawn from."""
        return Grid(self.name, self.content, self.overrides)

    @property
    def hash(self) -> str:
        """16 hex digits that change with the grid and with the number of points."""
        return content_hash({"grid": super().hash, "points": self.points})

    @cached_property
    def drawn(self) -> dict[int, tuple[str, ...]]:
        """The members drawn, by the number of their group in the whole grid, in order."""
        strata = list(self._yield_strata())
        ends = np.cumsum([s.size for s in strata]).tolist()
        found: dict[int, list[str]] = {}
        for place in self._draw_places(ends[-1]):
            k = next(i for i, end in enumerate(ends) if place < end)
            cell, repeat = strata[k].group(place - ends[k] + strata[k].size)
            found.setdefault(repeat * self.cells + cell, []).append(strata[k].member.name)
        return {group: tuple(found[group]) for group in sorted(found)}

    @cached_property
    def _drawn_numbers(self) -> list[int]:
        return list(self.drawn)

    @property
    def group_count(self) -> int:
        """Number of groups that have a scenario in the sample."""
        return len(self.drawn)

    def size(self, index: int) -> int:
        """Return the number of scenarios drawn from the group that stands at a place of the
        sample.
        """
        return len(self.drawn[self._drawn_numbers[index]])

    def samples(self, most: int = 200) -> list[int]:
        """Return a few places of the sample: the first of each block, or the first ones of a single
        loop.
        """
        if not self.content.block:
            return list(range(min(self.group_count, most)))
        cells = np.array(self._drawn_numbers) % self.cells
        starts = [first for first, _ in self._cells_of_blocks]
        return np.unique(np.searchsorted(starts, cells, side="right"), return_index=True)[
            1
        ].tolist()

    def group(self, index: int) -> Group:
        """Build the group that stands at a place of the sample, with the members that were
        drawn.
        """
        number = self._drawn_numbers[index]
        group = self.whole.group(number)
        kept = tuple(d for d in group.drafts if d.tags["member"] in self.drawn[number])
        return replace(group, index=index, drafts=kept)

    def _yield_strata(self) -> Iterator[_Stratum]:
        # A grid of one loop has one block and one member
        every = (Member(name="loop", valve=""),)
        blocks: Sequence[Any] = self.content.block or (None,)
        for (first, _), axes, block in zip(
            self._cells_of_blocks, self._axes_of_blocks, blocks, strict=True
        ):
            # The values of each axis that the member is kept to
            for member in every if block is None else block.member:
                allowed = []
                for key, values in axes.items():
                    allowed.append(
                        tuple(i for i, v in enumerate(values) if v in member.where.get(key, values))
                    )
                sizes = tuple(map(len, axes.values()))
                yield _Stratum(member, first, sizes, tuple(allowed), self.content.repeats)

    def _draw_places(self, total: int) -> Iterator[int]:
        """Yield increasing places in the list of all scenarios, each place with probability
        points/total.
        """
        rng = np.random.default_rng([self.content.seed, self.points])
        start = rng.random()
        for part in range(self.points):
            lo = part * total // self.points
            hi = (part + 1) * total // self.points
            # parts are whole numbers long: by this rounding the longer ones get their share
            count = math.floor(start + hi * self.points / total) - math.floor(
                start + lo * self.points / total
            )
            yield from sorted(
                lo + i for i in rng.choice(hi - lo, min(count, hi - lo), replace=False).tolist()
            )

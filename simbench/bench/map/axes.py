"""A grid's axes as numbers: what a surrogate is trained on, for any cells of a grid of any size."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from scenarios.grid import Grid

BLOCK = "block"


class GridAxes:
    """The axes of a grid and their values, in order; `block` is one where there are several blocks."""

    def __init__(self, grid: Grid) -> None:
        content = grid.content
        self._blocks: list[Mapping[str, Sequence[Any]]] = [b.axes for b in content.block] or [content.axes]
        self._names = [b.name for b in content.block] or ["loop"]
        self._ends = np.cumsum([math.prod(map(len, axes.values())) for axes in self._blocks])
        # what a cell's members are called, and on which values of its axes each is there
        self.members = [[(m.name, m.where) for m in b.member] for b in content.block] or [[("loop", {})]]
        self.values: dict[str, list[Any]] = {}
        for axes in self._blocks:
            for key, values in axes.items():
                known = self.values.setdefault(key, [])
                known += [v for v in values if v not in known]
        for values in self.values.values():
            if all(isinstance(v, (int, float)) for v in values):
                values.sort()
        if len(self._names) > 1:
            self.values = {BLOCK: list(self._names), **self.values}
        self.several = [key for key, values in self.values.items() if len(values) > 1]

    @cached_property
    def member_names(self) -> list[str]:
        """Every name that a member has in some block, each once."""
        return list(dict.fromkeys(name for members in self.members for name, _ in members))

    def codes(self, cells: np.ndarray) -> np.ndarray:
        """Return, for cells by number, the place of each axis' value (cells x axes); -1 where the cell lacks the axis."""
        out = np.full((cells.size, len(self.values)), -1, dtype=np.int32)
        block = np.searchsorted(self._ends, cells, side="right")
        for number, axes in enumerate(self._blocks):
            here = np.flatnonzero(block == number)
            rest = cells[here] - (self._ends[number - 1] if number else 0)
            for key, values in reversed(list(axes.items())):
                rest, place = np.divmod(rest, len(values))
                out[here, list(self.values).index(key)] = np.array([self.values[key].index(v) for v in values])[place]
        if BLOCK in self.values:
            out[:, 0] = block
        return out

    def present(self, codes: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return which member is there in which cell (members x cells), as `codes` has the cells."""
        block = np.searchsorted(self._ends, cells, side="right")
        found, keys = np.zeros((len(self.member_names), cells.size), dtype=bool), list(self.values)
        for number, members in enumerate(self.members):
            for name, where in members:
                there = block == number
                for key, allowed in where.items():
                    places = [self.values[key].index(v) for v in allowed if v in self.values[key]]
                    there = there & np.isin(codes[:, keys.index(key)], places)
                found[self.member_names.index(name)] |= there
        return found

"""Represent the axes of a grid in tables and as inputs of a surrogate model, for grids of any
size.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.scenarios.grid import Grid

if TYPE_CHECKING:
    import pandas as pd

BLOCK_AXIS = "block"


class GridAxes:
    """The axes of a grid and their values, in order; `block` is one where there are several
    blocks.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid, blocks = grid, grid.content.block
        every = [b.axes for b in blocks] or [grid.content.axes]
        self.values: dict[str, list[Any]] = (
            {BLOCK_AXIS: [b.name for b in blocks]} if len(blocks) > 1 else {}
        )
        for axes in every:
            for key, values in axes.items():
                known = dict.fromkeys([*self.values.get(key, ()), *map(shown, values)])
                self.values[key] = (
                    list(known) if any(isinstance(v, str) for v in known) else sorted(known)
                )
        self.members = list(dict.fromkeys(m.name for b in blocks for m in b.member)) or ["loop"]

    @property
    def several(self) -> list[str]:
        """The axes with two values or more."""
        return [key for key, values in self.values.items() if len(values) > 1]

    def table(self, cells: Iterable[int]) -> tuple[pd.DataFrame, list[tuple[str, ...]]]:
        """Return the value of each axis in some cells (null where a cell lacks it), and the members
        of each cell.
        """
        import pandas as pd

        contents = [self._grid.cell(int(cell)) for cell in cells]
        rows = [
            {BLOCK_AXIS: block, **{k: shown(v) for k, v in values.items()}}
            for block, values, _ in contents
        ]
        return pd.DataFrame(rows, columns=list(self.values)), [members for *_, members in contents]

    def features(self, table: pd.DataFrame, members: Iterable[str]) -> np.ndarray:
        """Return the place of each value on its axis (-1 where a cell lacks the axis), and of the
        member, as columns.
        """
        import pandas as pd

        codes = [pd.Categorical(table[key], values).codes for key, values in self.values.items()]
        return np.column_stack([*codes, [self.members.index(name) for name in members]])


def shown(value: Any) -> Any:
    """Return an axis value as a table holds it: sections and lists of a loop file, which can be
    axes too, as JSON.
    """
    return value if isinstance(value, (str, int, float)) else json.dumps(value, sort_keys=True)

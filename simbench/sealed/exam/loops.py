"""The loops of an exam in its key: settled anew from the grid, or a table that stands as it is."""

from __future__ import annotations

from base64 import b64decode, b64encode
from collections.abc import Mapping
from typing import Any

from simbench.bench.store.benchmark import grid_of
from simbench.scenarios.grid import Grid
from simbench.scenarios.settled import SettledGrid

_TABLE, _PLANNED = "table", "planned"


def table_in_key(grid: Grid) -> dict[str, Any]:
    """Return what a key holds of a grid besides its settings."""
    if not isinstance(grid, SettledGrid):
        return {}
    return {_TABLE: b64encode(grid.table).decode(), _PLANNED: grid.planned}


def grid_in_key(secret: Mapping[str, Any]) -> Grid:
    """Return the grid that a key holds; KeyError, TypeError or ValueError where it is none."""
    grid = grid_of({**secret, "grid": str(secret["grid"])})
    if _TABLE not in secret:
        return grid
    table = b64decode(secret[_TABLE])
    return SettledGrid(grid.name, grid.content, grid.overrides, table, int(secret[_PLANNED]))

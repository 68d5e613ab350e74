"""The grids that come with the package."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from simbench.scenarios.grid_file import GridFile
from simbench.scenarios.toml import read_toml
from simbench.scenarios.toml_table import checked


def grid_names() -> list[str]:
    """Return the names of the grids that come with the package."""
    folder = files("simbench.scenarios") / "grids"
    return sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml"))


def packaged_table(name: str) -> dict[str, Any]:
    """Return the table of a packaged grid's file."""
    return read_toml(Path(str(files("simbench.scenarios") / "grids" / f"{name}.toml")))


@cache
def packaged_file(name: str) -> GridFile:
    """Return the checked file of a packaged grid."""
    return checked(GridFile, packaged_table(name), name)

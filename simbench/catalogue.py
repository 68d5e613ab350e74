"""List the available detectors, valves, grids, effects and figures, with one line and the source of
each (`simbench list`).
"""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any

from simbench.detectors.plugins.registry import PluginFolder, methods
from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import VALVES

if TYPE_CHECKING:
    from simbench.scenarios.expansion import Grid

FIGURES = PluginFolder("figure", "simbench.figures", "simbench.figures", ("SOURCE", "data", "draw"))
LISTED_KINDS = ("detectors", "valves", "grids", "effects", "figures")


def catalogue(what: str) -> list[dict[str, Any]]:
    """List the plug-ins of one kind.

    Examples
    --------
    >>> [row["name"] for row in catalogue("valves") if row["name"] == "choudhury"]
    ['choudhury']
    """
    if what == "grids":
        from simbench.scenarios.grid import load_grid
        from simbench.scenarios.packaged import grid_names

        return [_grid_row(load_grid(name)) for name in grid_names()]
    folder = {"detectors": methods, "valves": VALVES, "effects": PLUGINS, "figures": FIGURES}[what]
    rows = []
    for name in folder.every_name():
        module = folder.load(name)
        source = module.METHOD.source if what == "detectors" else module.SOURCE
        # a figure's public id is its file name with hyphens
        shown = name.replace("_", "-") if what == "figures" else name
        rows.append({"name": shown, "says": _first_sentence(module), "source": source})
    return rows


def _grid_row(grid: Grid) -> dict[str, Any]:
    """Return what a grid is for, its source, and the AUC with which its loops are told from
    recorded ones.
    """
    told = grid.content.told_from_recorded
    about = {"name": grid.name, "says": grid.title, "source": grid.source}
    return {**about, "told_from_recorded": told}


def _first_sentence(module: ModuleType) -> str:
    return " ".join((module.__doc__ or "").strip().split("\n\n")[0].split()).rstrip(".")

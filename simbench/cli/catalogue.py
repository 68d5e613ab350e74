"""The verbs `list` (what is available) and `contract` (check a detector)."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit

from simbench.cli.common import Json, app, examples, show, show_result
from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.views import columns

if TYPE_CHECKING:
    from simbench.scenarios.expansion import Grid

LISTED_KINDS = ("detectors", "valves", "grids", "effects", "figures")


@app.command(epilog=examples("contract my_detector.py"))
def contract(
    path: Annotated[
        Path,
        Argument(
            metavar="FILE",
            help="Check this Python file of a detector.",
        ),
    ],
    as_json: Json = False,
) -> None:
    """Check whether a file can be used as a detector; exit 1 if it cannot.

    The file must load, describe itself in METHOD, and answer with a Verdict on a sticky, a healthy,
    a rescaled and a dead record, the same twice, without changing what it is given.
    """
    from simbench.detectors.contract import check_detector

    report = check_detector(path)
    show_result(report, as_json)
    if not report.kept:
        raise Exit(1)


@app.command("list", epilog=examples("list detectors", "list grids --json"))
def list_(
    what: Annotated[
        str | None,
        Argument(
            metavar="KIND",
            help="List detectors, valves, grids, effects, figures or thresholds.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the available detectors, valve models, grids, effects, figures or thresholds.

    Each line has the name, what it is, and its source in brackets. A grid is a set of scenarios to
    simulate; its AUC is that with which a classifier tells its loops from recorded ones
    (0.5: not at all, 1: always; see `simbench gap grid`). An effect is a property of a plant that a
    simulation may lack, such as sensor lag. The thresholds are those of the conclusion and of the
    diagnosis, each with its unit.
    """
    from simbench.cli.catalogue import LISTED_KINDS, catalogue
    from simbench.gap import thresholds

    kinds = LISTED_KINDS + ("thresholds",)
    if what is None:
        show(list(kinds) if as_json else "\n".join(f"simbench list {k}" for k in kinds), as_json)
        return
    if what not in kinds:
        raise ParameterError(f"nothing to list under {what!r}: {nearest(what, kinds)}")
    if what == "thresholds":
        rows = thresholds.rows()
    else:
        rows = catalogue(what)
    show(rows if as_json else "\n".join(_lines_of(rows)), as_json)


def _lines_of(rows: list[dict[str, Any]]) -> list[str]:
    """Return a line per row, of grids under a head and with their AUC."""
    lines = [(r["name"], f"{r['says']} [{r['source']}]") for r in rows]
    if any("told_from_recorded" in r for r in rows):
        told = [r["told_from_recorded"] for r in rows]
        aucs = ["" if auc is None else f"{auc:.2f}" for auc in told]
        head = ("grid", "AUC", "what it is for (AUC: how plainly it is told from recorded loops)")
        lines = [head] + [(n, auc, says) for (n, says), auc in zip(lines, aucs, strict=True)]
    return columns(lines)


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

    # here, for other verbs load neither valves nor figures
    from simbench.detectors.plugins.registry import methods
    from simbench.figures._folder import FIGURES
    from simbench.loop.effects import PLUGINS
    from simbench.loop.parameters import VALVES

    folder = {"detectors": methods, "valves": VALVES, "effects": PLUGINS, "figures": FIGURES}[what]
    rows = []
    for name in sorted(folder.every_name(), key=_by_number):
        module = folder.load(name)
        if what == "detectors":
            source = module.METHOD.source
        else:
            source = module.SOURCE
        # a figure's public id is its file name with hyphens
        if what == "figures":
            shown = name.replace("_", "-")
        else:
            shown = name
        rows.append({"name": shown, "says": _first_sentence(module), "source": source})
    return rows


def _by_number(name: str) -> list[Any]:
    """Return what sorts names by the numbers in them."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def _grid_row(grid: Grid) -> dict[str, Any]:
    """Return what a grid is for, its source, and the AUC with which its loops are told from
    recorded ones.
    """
    told = grid.content.told_from_recorded
    about = {"name": grid.name, "says": grid.title, "source": grid.source}
    return {**about, "told_from_recorded": told}


def _first_sentence(module: ModuleType) -> str:
    return " ".join((module.__doc__ or "").strip().split("\n\n")[0].split()).rstrip(".")

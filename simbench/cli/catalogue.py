"""The verbs `list` (what is available) and `contract` (check a plug-in)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit

from simbench.cli.common import Json, app, examples, show, show_result
from simbench.detectors.errors import ParameterError, nearest


@app.command(epilog=examples("contract my_detector.py"))
def contract(
    path: Annotated[
        Path,
        Argument(
            metavar="FILE",
            help=(
                "Check this file: a detector, valve, effect, plant, controller or plant simulator "
                "(.py), or a grid (.toml)."
            ),
        ),
    ],
    as_json: Json = False,
) -> None:
    """Check whether a plug-in can be used by simbench; exit 1 if it cannot.

    A plug-in is a Python file of yours that adds a detector, a valve model, an effect or a plant.
    The contract is the list of names and functions that such a file must have.
    """
    from simbench.contract import check_in_subprocess

    report = check_in_subprocess(path)
    show_result(report, as_json)
    if not report.kept:
        raise Exit(1)


@app.command("list", epilog=examples("list detectors", "list grids --json"))
def list_(
    what: Annotated[
        str | None,
        Argument(metavar="KIND", help="List detectors, valves, grids, effects or figures."),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the available detectors, valve models, grids, effects or figures.

    Each line has the name, what it is, and its source in brackets. A grid is a set of scenarios to
    simulate. An effect is a property of a plant that a simulation may lack, such as sensor lag.
    """
    from simbench.catalogue import LISTED_KINDS, catalogue

    if what is None:
        show(
            list(LISTED_KINDS)
            if as_json
            else "\n".join(f"simbench list {kind}" for kind in LISTED_KINDS),
            as_json,
        )
        return
    if what not in LISTED_KINDS:
        raise ParameterError(f"nothing to list under {what!r}: {nearest(what, LISTED_KINDS)}")
    rows = catalogue(what)
    width = max((len(r["name"]) for r in rows), default=0)
    show(
        rows
        if as_json
        else "\n".join(f"{r['name']:<{width}}  {r['says']} [{r['source']}]" for r in rows),
        as_json,
    )

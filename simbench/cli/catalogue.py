"""What there is, and whether a plug-in keeps its contract."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit

from detectors.errors import ParameterError, nearest
from simbench.cli.common import Json, app, examples, show, show_result


@app.command(epilog=examples("contract my_detector.py"))
def contract(
    path: Annotated[
        Path,
        Argument(
            metavar="FILE",
            help=(
                "Check this file: a detector, valve, effect, recogniser or world (.py), or a grid "
                "(.toml)."
            ),
        ),
    ],
    as_json: Json = False,
) -> None:
    """Check whether a plug-in keeps its contract; exit 1 when it does not."""
    from simbench.contract import check_in_subprocess

    report = check_in_subprocess(path)
    show_result(report, as_json)
    if not report.kept:
        raise Exit(1)


@app.command("list", epilog=examples("list detectors", "list grids --json"))
def list_(
    what: Annotated[
        str | None, Argument(help="List detectors, valves, grids, effects or figures.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List what is available, with one line and the source of each."""
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

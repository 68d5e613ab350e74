"""A plant's loops: whom to trust on one, all of them on a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from simbench.cli.common import Jobs, Json, Page, app, examples, reads, say_assumed, show_found


@app.command(
    "trust", epilog=examples("trust rec.csv", "trust rec.csv --loop loop.toml --html trust.html")
)
@reads()
def trust_(
    path: Annotated[Path, Argument(metavar="REC.csv")],
    loop: Annotated[
        Path | None, Option(metavar="LOOP.toml", help="The loop; identified if absent.")
    ] = None,
    method: Annotated[
        list[str] | None, Option(metavar="ID", help="Method ids, all, fast or full; repeatable.")
    ] = None,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Say which detector to trust on this very loop, what it could have seen, and how probable
    stiction is.
    """
    from simbench.plant.command import trust_file

    found = trust_file(path, loop, method or ["all"], html=html, **about)
    show_found(found, as_json)
    say_assumed([found.record], as_json)


@app.command(
    "report",
    epilog=examples(
        "report folder -o plant.html --orders orders.xlsx",
        "report week2 -o w2/page.html --previous w1",
    ),
)
@reads()
def report_(
    folder: Annotated[
        Path, Argument(metavar="FOLDER", help="Records of a plant's loops, or a file with several.")
    ],
    labels: Annotated[
        Path | None, Option(help="Table with id and label: judge its records.")
    ] = None,
    out: Annotated[Path, Option("-o", "--out", help="Page; a CSV is written beside it.")] = Path(
        "report.html"
    ),
    orders: Annotated[
        Path | None, Option(metavar="FILE.xlsx|.csv", help="Table of work orders to write.")
    ] = None,
    previous: Annotated[
        Path | None,
        Option(metavar="FOLDER", help="Of last week's report: causes that return are said to."),
    ] = None,
    jobs: Jobs = 2,
    *,
    about: dict,
) -> None:
    """Put a plant's loops on one page: who must do what, ranked by what the cause costs and how
    sure it is.
    """
    from simbench.plant.command import report_folder

    fleet, beside = report_folder(
        folder, out, labels, jobs=jobs, orders=orders, previous=previous, **about
    )
    print(fleet.as_text())
    say_assumed([m.trust.record for m in fleet.members], as_json=False)
    print(f"page: {out.resolve()}; table: {beside.resolve()}")

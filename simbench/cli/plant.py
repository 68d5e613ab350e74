"""The verbs `trust` (which method to trust on one loop) and `report` (all loops of a plant)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from simbench.cli.common import (
    Jobs,
    Json,
    Page,
    app,
    examples,
    reads,
    say,
    say_assumed,
    show,
    show_result,
)


@app.command(
    "trust", epilog=examples("trust rec.csv", "trust rec.csv --loop loop.toml --html trust.html")
)
@reads()
def trust_(
    path: Annotated[Path, Argument(metavar="REC.csv", help="Read this record.")],
    loop: Annotated[
        Path | None,
        Option(
            metavar="LOOP.toml",
            help="Simulate this loop file (as `simbench simulate` reads it) instead of a loop"
            " identified from the record. In `simbench detect`, --loop chooses a tag instead.",
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        Option(
            metavar="ID",
            help="Apply these methods: ids, or the groups all, fast or full; may be repeated"
            " [all].",
        ),
    ] = None,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Report which detector to trust on a loop, and which stiction its record could show.

    The loop is simulated again about 200 times, with a healthy valve and with stiction of ten
    sizes. Every detector judges these simulated replicates, for which the right answer is known.

    The table has one row per method: those that agree with the conclusion first, then by accuracy.
    With the published threshold: its verdict on the record, its false-positive rate on healthy
    replicates, and the smallest stick band S from which it detects four of five sticky replicates,
    for a slip-jump J of S/4 and of S.
    As advised for this loop: the score above which the method should report stiction (empty: as
    published), and its accuracy on the replicates with that threshold.
    """
    from simbench.plant.command import trust_file

    trust = trust_file(path, loop, method or ["all"], html=html, **about)
    show_result(trust, as_json)
    say_assumed([trust.record], as_json)


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
        Path,
        Argument(
            metavar="FOLDER",
            help=(
                "Read the records of a plant's loops from this folder, or from one file that holds"
                " several."
            ),
        ),
    ],
    labels: Annotated[
        Path | None, Option(help="Judge the records that this table lists (columns id and label).")
    ] = None,
    out: Annotated[
        Path,
        Option(
            "-o",
            "--out",
            help="Write the HTML page to this file, and a CSV of the same name next to it.",
        ),
    ] = Path("report.html"),
    orders: Annotated[
        Path | None,
        Option(metavar="FILE.xlsx|.csv", help="Write a table of work orders to this file."),
    ] = None,
    previous: Annotated[
        Path | None,
        Option(
            metavar="FOLDER",
            help="Compare with the earlier report in this folder, and mark the causes that return.",
        ),
    ] = None,
    jobs: Jobs = 2,
    *,
    about: dict,
) -> None:
    """Rank the loops of a plant by what their cause costs, and list what to do next.

    The table has one row per loop, the most urgent first: the probability that its valve has
    stiction, the estimated stick band S (in % of travel if the span of OP is known), the most
    likely cause, and what to work on (valve, tuning, upstream process, measurement or nothing). The
    HTML page has the evidence for every loop.
    """
    from simbench.plant.command import report_folder

    fleet, table = report_folder(
        folder, out, labels, jobs=jobs, orders=orders, previous=previous, **about
    )
    show(fleet.as_text(), as_json=False)
    say_assumed([m.trust.record for m in fleet.members], as_json=False)
    say(f"page: {out.resolve()}\ntable: {table.resolve()}")

"""The verbs `detect` and `diagnose`: what a record shows about its valve."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from simbench.cli.common import (
    Json,
    MethodIds,
    Page,
    Plugin,
    app,
    examples,
    reads,
    refuse_picture,
    say,
    say_assumed,
    show,
    show_result,
)
from simbench.detectors.errors import masked

if TYPE_CHECKING:
    from simbench.detectors.report.report import Report


@app.command(
    epilog=examples(
        "detect rec.csv --kind flow --why",
        "detect export.csv --columns op=FIC101.OUT,pv=FIC101.MEAS --html verdict.html",
        "detect folder --labels records.csv --csv verdicts.csv",
    )
)
@reads
def detect(
    path: Annotated[
        Path,
        Argument(metavar="REC.csv|DIR", help="Read this record, or every record of this folder."),
    ],
    method: MethodIds = None,
    labels: Annotated[
        Path | None,
        Option(
            metavar="FILE.csv",
            help="Judge only the records that this table lists (columns id and label), and score"
            " every method against the labels.",
        ),
    ] = None,
    plugin: Plugin = None,
    why: Annotated[
        bool, Option("--why", help="Print each method's reason below the table.")
    ] = False,
    csv: Annotated[
        Path | None,
        Option("--csv", metavar="FILE.csv", help="Write the verdicts to this table (CSV)."),
    ] = None,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Judge whether the valve sticks in a record, or in every record of a folder.

    The first lines give the conclusion: stiction, no stiction or cannot tell, with its probability.
    It comes from a comparison of loop models with and without valve friction (the method
    `likelihood`), not from a vote of the other methods. If --method names other methods only, their
    verdicts are printed without a conclusion. In JSON every verdict carries the `conclusion` about
    its record.

    The table has one row per method: its verdict, its score (each method has its own scale and
    threshold; more means that stiction is more likely), and the stick band S and slip-jump J that
    it estimates.

    Of a folder the first table has one row per loop, ranked by the probability of stiction; loops
    that share an oscillation have the same event number. A file that is no record is listed with
    its reason, and the exit code is 1.

    A record is a table (CSV, text, parquet, Excel, .mat) with a row per time and a column each for
    op and pv, and for sp, mv, mode and the time where they are recorded; a tag may stand before
    (FIC9.OP). Several loops have tags in the names of their columns, or a column of loop names.
    Gaps of up to 3 samples are bridged; of a longer one the longest whole part is judged.
    """
    from simbench.detectors.report.report import describe_failures, table
    from simbench.files import refuse_kind, refuse_own_input
    from simbench.verbs import judge_files

    refuse_kind(csv or "")
    refuse_own_input([csv, html], [path, labels] + (plugin or []))
    printed: list[str] = []

    def print_conclusion(report: Report) -> None:
        printed.append(report.opening())
        show(printed[0], False)

    report = judge_files(
        path,
        method or ["all"],
        labels=labels,
        plugins=plugin or [],
        concludes=True if html is not None else None,
        # a file is written before anything is printed: who reads the text may stop reading
        at_once=print_conclusion if not as_json and csv is None and html is None else None,
        **about,
    )
    for name, sentence in report.refused.items():
        print(f"left out {name}: {sentence}", file=sys.stderr)
    for sentence in describe_failures(report.verdicts):
        print(sentence, file=sys.stderr)
    if as_json and report.scores:
        print("\n".join(["score by unit:"] + table(report.scores)), file=sys.stderr)
    if csv is not None:
        from simbench.files import write_table

        write_table(report.loops() if report.of_folder else report.to_frame(), csv)
    if html is not None:
        from simbench.page.detect_page import write_page

        write_page(report, html, masked(shlex.join(["simbench"] + sys.argv[1:])))
    if as_json:
        show(report.as_json(), as_json)
    else:
        text = report.as_text(why=why)
        show(text.removeprefix("".join(printed)).removeprefix("\n"), False)
    if labels is not None and report.conclusions:
        from simbench.detectors.records.folder import read_labels
        from simbench.gap.stiction.conclusion import as_lines

        print("\n".join([""] + as_lines(report.conclusions, read_labels(labels))))
    if as_json or len(report.groups()) > 1:  # of one record the text has them
        say_assumed(report.records.values(), as_json)
    if html is not None:
        say(f"page: {html.resolve()}", as_json)
    if report.refused:
        raise Exit(1)


@app.command(epilog=examples("diagnose rec.csv --kind flow --picture path.svg"))
@reads
def diagnose(
    path: Annotated[Path, Argument(metavar="REC.csv", help="Read this record.")],
    picture: Annotated[
        Path | None, Option(help="Draw the steps of the diagnosis to this file (SVG or PNG).")
    ] = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Find what makes a loop oscillate: stiction, tuning, a disturbance or another cause.

    The output has three parts: the conclusion with its probability of stiction; every cause with
    the confidence (0 to 1) that the evidence for it gives; and the diagnosis procedure of the book
    chapter that simbench implements, question by question.
    """
    from simbench.detectors.records.io import read_record
    from simbench.verbs import diagnose as diagnose_record

    refuse_picture(picture, path)
    diagnosis = diagnose_record(read_record(path, **about))
    if picture is not None:
        from simbench.figures import draw_path

        draw_path(diagnosis.procedure, picture)
    show_result(diagnosis, as_json)
    say_assumed([diagnosis.record], as_json)

"""The verbs that read a run: score it, compare it with a baseline, draw a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from simbench.cli.common import (
    AllowFailed,
    Full,
    Json,
    Report,
    app,
    axis_name,
    end_by_failures,
    examples,
    pairs,
    say,
    show,
    show_result,
    where_more_is,
)
from simbench.detectors.errors import ParameterError, nearest

Run = Annotated[
    Path, Argument(metavar="RUN", help="Read the run in this folder, as `simbench run` wrote it.")
]


@app.command(
    epilog=examples(
        "score runs/chapter --report report.html",
        "score runs/chapter --by S_over_2J --by Td_over_T",
        "score runs/chapter --paired --to pairs.csv",
        "score runs/chapter --to table.tex",
    )
)
def score(
    folder: Run,
    report: Report = None,
    paired: Annotated[
        bool,
        Option(
            "--paired",
            help="Compare every two methods of this run with each other, scenario by scenario.",
        ),
    ] = False,
    by: Annotated[
        list[str] | None,
        Option(
            metavar="AXIS",
            help="Print accuracy, sensitivity and false positives over this axis of the grid,"
            " for example S_over_2J, or valve.S where a grid varies it; given twice, accuracy over"
            " both, and with --method the two other shares as well.",
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        Option(
            metavar="ID",
            help="Show this method of the run alone, or several with commas, with their ranks among"
            " all; with --paired compare them with every other; may be repeated.",
        ),
    ] = None,
    to: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Write the ranking, or what --paired or --by prints, as a table for a paper (.tex,"
            " .md) or as numbers (.csv), or the ranking as a picture (.svg, .pdf, .png).",
        ),
    ] = None,
    cost: Annotated[
        float,
        Option(
            "--cost",
            min=0.0,
            max=1.0,
            help="Set the cost of a no-decision answer relative to an error (an error costs 1).",
        ),
    ] = 0.5,
    truth: Annotated[
        str,
        Option(
            metavar="cycled|predicted|sticky",
            help="Choose the label that verdicts are compared with: the simulated valve makes"
            " the loop"
            " cycle (cycled), theory predicts a cycle (predicted), or the valve has friction"
            " (sticky).",
        ),
    ] = "cycled",
    allow_failed: AllowFailed = 0.0,
    full: Full = False,
    as_json: Json = False,
) -> None:
    """Score a run: rank its methods on the loops that oscillate, with 95 % intervals.

    The table has one row per method. Rank 1: no method costs less by a difference that these loops
    resolve; 2: only methods of rank 1 do; and so on. Cost: mean over the loops of 1 for a wrong
    verdict, 0.5 for no decision and 0 for a right one. Accuracy: share of right verdicts; no
    decision counts as wrong. Sensitivity: share of the loops that the valve makes cycle called
    stiction. False positives: share of the other loops called stiction. No decision: share of loops
    without a verdict. Two numbers after a value are its 95 % interval.

    Methods that need the valve position (MV) are ranked among themselves. Reference rows are no
    detectors: the oracle knows the loop, no_waveform is a classifier that sees period, amplitude
    and noise but no waveform, and rhythm one that also sees how regular the cycles are. A useful
    detector costs less than both.
    """
    from simbench.bench.execute.failures import read_failures
    from simbench.bench.score.asked import Asked
    from simbench.bench.score.scoring import score_book
    from simbench.bench.score.shipped import read_joined
    from simbench.bench.store.reading import TRUTHS
    from simbench.detectors.sources import split_names
    from simbench.figures._asked import write_asked
    from simbench.files import refuse_own_input

    if truth not in TRUTHS:
        raise ParameterError(f"--truth {truth}: {nearest(truth, TRUTHS)}")

    # score the run, and show some methods of it
    refuse_own_input([report, to], [folder])
    book = read_joined(folder)
    scores = score_book(book, cost, allow_failed)
    failed = read_failures(folder)
    if method:
        scores = scores.of(split_names(method))
    answer = Asked(scores, truth, paired, list(map(axis_name, by or [])))

    # write what goes into a file before what goes to the terminal, which may have no reader
    if to is not None:
        write_asked(answer, to)
    if as_json:
        show({**scores.as_json(), **answer.as_json(), "failed": failed.as_json()}, as_json)
    else:
        show(answer.as_text(full, where_more_is(folder, full) if report is None else ""), as_json)
    if to is not None:
        say(f"{to.suffix[1:]}: {to.resolve()}", as_json)

    # the page, and an exit code that counts failed methods
    if report is not None:
        from simbench.bench.score.page import write_page

        write_page(scores, folder, report, truth, str(failed))
        say(f"report: {report.resolve()}", as_json)
    end_by_failures(failed, allow_failed)


@app.command(
    epilog=examples("check run --against my_baseline", "check run --against my_baseline --json")
)
def check(
    folder: Run,
    against: Annotated[
        Path,
        Option(metavar="DIR", help="Compare with the baseline, an earlier run, in this folder."),
    ],
    markdown: Annotated[
        Path | None, Option(metavar="FILE.md", help="Write a Markdown summary to this file.")
    ] = None,
    update: Annotated[
        bool,
        Option("--update", help="Replace the baseline by this run, and print the differences."),
    ] = False,
    margin: Annotated[
        float,
        Option(min=0.0, max=1.0, help="Allow each of these rates to worsen by this much (0 to 1)."),
    ] = 0.01,
    exact: Annotated[
        bool,
        Option(
            "--exact",
            help="Fail on every changed verdict or score of a built-in method, and list them; for"
            " runs of one machine.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Compare a run with a baseline, loop by loop; exit 1 if a detector became worse.

    Worse is a method that is right on fewer loops, finds or denies stiction on fewer, or reports it
    on more loops without any, by more than the margin and than chance explains. Exit codes: 0 no
    loss, 1 worse, 2 the two cannot be compared or the command is wrong, 3 cannot tell (answers were
    lost, and the loops are too few to find a loss that matters). A chaotic loop may have other last
    bits on another processor: the check says of how many loops.

    Use it in continuous integration: make a baseline once with --update, commit it, and let this
    command fail the build when a change makes a detector less accurate.
    """
    from simbench.bench.check.check import check_run, update_baseline
    from simbench.bench.check.check_result import NO_LOSS, NOT_COMPARABLE, WORSE
    from simbench.bench.store.folder import RunError
    from simbench.files import refuse_own_input, whole_file

    refuse_own_input([markdown], [folder, against])
    if update:
        say(update_baseline(folder, against))
        return
    try:
        result = check_run(folder, against, margin, exact)
    except RunError as error:
        if as_json:
            show({"result": NOT_COMPARABLE, "reason": str(error)}, as_json)
        raise
    if markdown is not None:
        with whole_file(markdown) as f:
            f.write(result.as_markdown())
    show_result(result, as_json)
    if result.result != NO_LOSS:
        raise Exit(1 if result.result == WORSE else 3)


@app.command(
    epilog=examples(
        "figure fig-11-9 -o figures",
        "figure fig-11-8 -o figures --set S=5 --set Td_over_T=0.3",
        "figure all -o figures",
    )
)
def figure(
    ids: Annotated[
        list[str],
        Argument(
            metavar="ID|all", help="Draw these figures; `simbench list figures` names them all."
        ),
    ],
    out: Annotated[Path, Option("-o", "--out", help="Write the figures to this folder.")],
    isdb: Annotated[
        Path | None,
        Option(metavar="FILE|DIR", help="Draw figures that show real records from this folder."),
    ] = None,
    sets: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="K=V",
            help="Draw the loops with another number: K, T, Td, Kc, Ti, Ts, S, J, Td_over_T,"
            " Td_over_Ti or S_over_2J; may be repeated.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Draw the figures and tables of the book chapter, and write their numbers as CSV.

    Below each figure's files stand what it shows, where it differs from the book, and its source.

    With `all`, figures are left out whose data are not given.
    """
    from simbench.figures import make_figures, where_from

    numbers = pairs(sets or [], "--set")
    numbers = {k: float(v) if isinstance(v, int) else v for k, v in numbers.items()}
    drawn = make_figures(ids, out, isdb=isdb, numbers=numbers)
    lacking = [where_from(d) for d in drawn if d.left_out]
    if lacking and "all" not in ids:
        raise ParameterError("; ".join(lacking))
    rows = [{"id": d.id, "files": [str(f) for f in d.files], "left_out": d.left_out} for d in drawn]
    lines = []
    for row, one in zip(rows, drawn, strict=True):
        lines.append(f"{row['id']}: {row['left_out'] or ', '.join(row['files'])}")
        if row["files"]:
            lines += [f"  {one.caption}"]
    show(rows if as_json else "\n".join(lines), as_json)

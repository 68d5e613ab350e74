"""The verbs of the benchmark: simulate a grid, score it, compare it, guard its accuracy."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option

from simbench.cli.common import (
    Address,
    Backend,
    ControllerPlugin,
    EffectPlugin,
    Full,
    GridName,
    Jobs,
    Json,
    Limit,
    PlantPlugin,
    Plugin,
    Report,
    Resume,
    ValvePlugin,
    app,
    examples,
    number,
    pairs,
    reads,
    say,
    show,
    show_result,
)
from simbench.detectors.errors import ParameterError, nearest

if TYPE_CHECKING:
    from simbench.bench.execute.failures import Failures

Run = Annotated[
    Path, Argument(metavar="RUN", help="Read the run in this folder, as `simbench run` wrote it.")
]

AllowFailed = Annotated[
    float,
    Option(
        metavar="SHARE",
        min=0.0,
        max=1.0,
        help=(
            "Allow this share of scenarios, or of a method's records, to fail; above it the method"
            " is not ranked, and the exit code is 1."
        ),
    ),
]


@app.command(
    epilog=examples(
        "run smoke -o runs/smoke",
        "run chapter -o runs/chapter -j 2 --method fast,oracle --resume",
        "run my_baseline -o run --plugin mine.py --method mine",
        "run --again runs/theirs/manifest.json -o runs/ours",
        "run runs/chapter --add --plugin mine.py --method mine",
        "run runs/chapter --answers theirs.csv",
        "run records -o runs/ours -j 2",
    )
)
@reads
def run(
    grid: GridName = None,
    out: Annotated[
        Path | None, Option("-o", "--out", help="Write the run to this folder [runs/GRID].")
    ] = None,
    jobs: Jobs = 1,
    method: Annotated[
        list[str] | None,
        Option(
            metavar="ID",
            help=(
                "Apply these methods: ids, or the groups fast, full and oracle; may be repeated "
                "[fast, oracle]. The oracle answers the label. The slow method likelihood is in no "
                "group; it must be named."
            ),
        ),
    ] = None,
    plugin: Plugin = None,
    valve_plugin: ValvePlugin = None,
    effect_plugin: EffectPlugin = None,
    plant_plugin: PlantPlugin = None,
    controller_plugin: ControllerPlugin = None,
    time_limit: Limit = 60.0,
    backend: Backend = "loky",
    address: Address = None,
    resume: Resume = False,
    n: Annotated[
        int | None,
        Option(
            "--n",
            min=1,
            help="Draw this many scenarios at random from the grid, which may be of any size; the"
            " seed of the grid decides which [all].",
        ),
    ] = None,
    sets: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="K=V",
            help="Change a setting of the grid, for example seed=7; may be repeated.",
        ),
    ] = None,
    axis: Annotated[
        list[str] | None,
        Option(
            metavar="K=a,b,c", help="Replace the values of an axis of the grid; may be repeated."
        ),
    ] = None,
    allow_failed: AllowFailed = 0.0,
    fresh_seeds: Annotated[
        bool, Option("--fresh-seeds", help="Draw a new seed instead of using the grid's.")
    ] = False,
    with_reference: Annotated[
        bool,
        Option(
            "--with-reference",
            help="Add the methods whose verdicts on this grid are shipped with simbench to the"
            " ranking, without asking them again; shipped are those of chapter, ci, families,"
            " plant, recorded and table-11-3.",
        ),
    ] = False,
    again: Annotated[
        Path | None,
        Option(
            metavar="MANIFEST",
            help="Take grid, methods and settings from this manifest of a finished run, in place of"
            " GRID; give the files of its plug-ins.",
        ),
    ] = None,
    add: Annotated[
        bool,
        Option(
            "--add",
            help="Add the methods of --method and --plugin to the finished run in the folder GRID:"
            " they are asked about its loops. With -o the result is another run.",
        ),
    ] = False,
    answers: Annotated[
        list[Path] | None,
        Option(
            metavar="FILE.csv",
            help="Add the answers in this file, of a program in any language, to the finished run"
            " in the folder GRID: columns method, record (as `simbench simulate GRID` names it),"
            " verdict, and if wanted score, S and J; may be repeated.",
        ),
    ] = None,
    full: Full = False,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Simulate a grid of scenarios, judge every record by the chosen methods, and score.

    GRID may be the folder of a run or a baseline: its loops are simulated again, under their ids;
    with --add or --answers, methods are added to that run.

    GRID may be a record, or a folder of records: of each the loop that copies it is simulated with
    a sound valve and with friction of several sizes, under fresh loads. That ranks the methods on
    loops like these. A record to which no loop is near is left out and named.

    `simbench score` prints the same table again; its help explains the columns.
    """
    from simbench.bench.execute.failures import read_failures
    from simbench.bench.execute.run import run_scored
    from simbench.bench.scenario.oracle import ORACLE
    from simbench.bench.score.scoring import score_run
    from simbench.bench.store.benchmark import is_records

    if about and not (grid is not None and is_records(grid)):
        option, value = next(iter(about.items()))
        raise ParameterError(
            f"--{option.lower().replace('_', '-')} {value} says how records are read; GRID is"
            f" {grid}: a record, or a folder of records, is needed"
        )
    axes = {
        k: [number(v) for v in str(values).split(",")]
        for k, values in pairs(axis or [], "--axis", text=True).items()
    }
    deciding: dict[str, Any] = {
        "n": n,
        "sets": pairs(sets or [], "--set"),
        "axes": axes,
        "fresh_seeds": fresh_seeds,
        "with_reference": with_reference,
    }
    working: dict[str, Any] = {
        "plugins": plugin or [],
        "valve_plugins": valve_plugin or [],
        "effect_plugins": effect_plugin or [],
        "plant_plugins": plant_plugin or [],
        "controller_plugins": controller_plugin or [],
        "backend": backend,
        "address": address,
        "resume": resume,
        "time_limit": time_limit,
    }
    told = {}
    with _interruptible():
        if add or answers:
            from simbench.bench.execute.add import add_to_run

            _refuse_beside_add(grid, again, deciding)
            folder, scores, told["added"] = add_to_run(
                str(grid),
                method or [],
                out,
                jobs,
                add=add,
                answers=answers or [],
                with_reference=with_reference,
                **working,
            )
        elif again is not None:
            from simbench.bench.execute.repeat import run_again

            _refuse_beside_again(grid, method, deciding)
            folder, scores, told["again"] = run_again(again, out, jobs, **working)
        elif grid is None:
            raise ParameterError(
                "GRID is missing: name a grid (`simbench list grids`), or give --again MANIFEST"
            )
        else:
            out = out or Path("runs") / Path(grid).stem
            plan: Any = grid
            if is_records(grid):
                from simbench.gap.benchmark.from_records import plan_of_records

                made = plan_of_records(grid, out, deciding, resume=resume, jobs=jobs, **about)
                say(made.as_text(), aside=True)
                plan = made.grid
                deciding = {"n": n}
            folder, scores = run_scored(
                plan, out, tuple(method or ["fast", ORACLE]), jobs, **deciding, **working
            )
    if scores is None or allow_failed:
        scores = score_run(folder, allow_failed=allow_failed)
    failed = read_failures(folder)
    if as_json:
        about = {"run": str(folder), "failed": failed.as_json()}
        show({**about, **told, **scores.as_json()}, as_json)
    else:
        lines = [scores.as_text(full=full, where=_where(folder, full)), f"run: {folder}"]
        lines += [text if key == "added" else f"again: {text}" for key, text in told.items()]
        show("\n".join(lines), as_json)
    _end(failed, allow_failed)


def _refuse_beside_add(grid: str | None, again: Path | None, deciding: dict[str, Any]) -> None:
    """Refuse what decides the loops of a run, where methods are added to a finished one."""
    from simbench.bench.store.benchmark import is_stored

    if grid is None or not is_stored(grid):
        raise ParameterError(
            f"--add and --answers add methods to a finished run; GRID is {grid}: the folder of a"
            " run is needed"
        )
    given = ["--again"] * (again is not None)
    given += [
        option
        for key, option in _DECIDING.items()
        if key != "with_reference" and deciding[key] not in (None, False, {})
    ]
    if given:
        raise ParameterError(
            f"--add and --answers take the loops of {grid} as they stand; leave out"
            f" {', '.join(given)}"
        )


def _refuse_beside_again(
    grid: str | None, method: list[str] | None, deciding: dict[str, Any]
) -> None:
    """Refuse what the manifest of --again decides."""
    given = [f"GRID {grid}"] * (grid is not None) + ["--method"] * bool(method)
    given += [option for key, option in _DECIDING.items() if deciding[key] not in (None, False, {})]
    if given:
        raise ParameterError(
            f"--again takes grid, methods and settings from the manifest; leave out"
            f" {', '.join(given)}"
        )


_DECIDING = {
    "n": "--n",
    "sets": "--set",
    "axes": "--axis",
    "fresh_seeds": "--fresh-seeds",
    "with_reference": "--with-reference",
}


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
            help="Show this method of the run alone, with its rank among all; with --paired compare"
            " it with every other; may be repeated.",
        ),
    ] = None,
    to: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Write the ranking, or what --paired or --by prints, as a table for a paper (.tex,"
            " .md), as numbers (.csv), or as a picture (.svg, .pdf, .png).",
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
    from simbench.bench.score.scoring import score_book
    from simbench.bench.score.shipped import read_joined
    from simbench.bench.score.show.asked import Asked
    from simbench.bench.store.reading import TRUTHS
    from simbench.figures._asked import write_asked
    from simbench.files import refuse_own_input

    if truth not in TRUTHS:
        raise ParameterError(f"--truth {truth}: {nearest(truth, TRUTHS)}")

    refuse_own_input([report, to], [folder])
    book = read_joined(folder)
    scores = score_book(book, cost, allow_failed)
    failed = read_failures(folder)
    scores = scores.of(method) if method else scores
    answer = Asked(scores, truth, paired, by or [])
    if to is not None:
        write_asked(answer, to)
    if as_json:
        show({**scores.as_json(), **answer.as_json(), "failed": failed.as_json()}, as_json)
    else:
        show(answer.as_text(full, _where(folder, full) if report is None else ""), as_json)
    if to is not None:
        say(f"{to.suffix[1:]}: {to.resolve()}", as_json)
    if report is not None:
        from simbench.report import write_report
        from simbench.report.data import RunData

        write_report(folder, report, RunData(folder, book, scores))
        say(f"report: {report.resolve()}", as_json)
    _end(failed, allow_failed)


@app.command(
    epilog=examples("check run --against my_baseline", "check run --against my_baseline --json")
)
def check(
    folder: Run,
    against: Annotated[
        Path,
        Option(metavar="DIR", help="Compare with the baseline, an earlier run, in this folder."),
    ],
    junit: Annotated[
        Path | None, Option(metavar="FILE.xml", help="Write a JUnit summary to this file.")
    ] = None,
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
    plugin: Annotated[
        list[Path] | None,
        Option(
            metavar="FILE.py",
            help="Load a plug-in that the run used, to ask it again where the bits of a record are"
            " not the baseline's; may be repeated.",
        ),
    ] = None,
    time_limit: Limit = 60.0,
    as_json: Json = False,
) -> None:
    """Compare a run with a baseline, loop by loop; exit 1 if a detector became worse.

    Worse is a method that is right on fewer loops, finds or denies stiction on fewer, or reports it
    on more loops without any, by more than the margin and than chance explains. Exit codes: 0 no
    loss, 1 worse, 2 the two cannot be compared or the command is wrong, 3 cannot tell (answers were
    lost, and the loops are too few to find a loss that matters). A chaotic loop may have other last
    bits on another processor: the check says of how many loops, and allows for the answers that
    this loses.

    Use it in continuous integration: make a baseline once with --update, commit it, and let this
    command fail the build when a change makes a detector less accurate.
    """
    from simbench.bench.execute.again import check_and_ask_again
    from simbench.bench.score.check import update_baseline
    from simbench.bench.score.check_result import NO_LOSS, NOT_COMPARABLE, WORSE
    from simbench.bench.store.folder import RunError
    from simbench.files import refuse_own_input, whole_file

    refuse_own_input([junit, markdown], [folder, against])
    if update:
        say(update_baseline(folder, against))
        return
    try:
        result = check_and_ask_again(folder, against, margin, exact, plugin or [], time_limit)
    except RunError as error:
        if as_json:
            show({"result": NOT_COMPARABLE, "reason": str(error)}, as_json)
        raise
    for path, text in ((junit, result.as_junit()), (markdown, result.as_markdown())):
        if path is not None:
            with whole_file(path) as f:
                f.write(text)
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
        # of all figures the gallery has the captions
        lines += [f"  {one.caption}"] if row["files"] and "all" not in ids else []
    show(rows if as_json else "\n".join(lines), as_json)


@app.command(epilog=examples("cite runs/chapter"))
def cite(folder: Run) -> None:
    """Print BibTeX of the methods, valve models and benchmark that a run used."""
    from simbench.bench import citing

    print(citing.cite(folder), end="")


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """End with exit code 130 and how to resume: the command-line library turns Ctrl-C into a bare
    exit code.
    """
    from simbench.bench.execute.run import Interrupted

    try:
        yield
    except Interrupted as stop:
        print(stop, file=sys.stderr)
        raise Exit(130) from None


def _where(folder: Path, full: bool) -> str:
    page = f"simbench score {folder} --report FILE.html"
    return (
        f"Columns: simbench score --help; {'' if full else 'every table: --full; '}a page: {page}"
    )


def _end(failed: Failures, allowed: float) -> None:
    """Report what failed, and end with 1 where it is more than allowed."""
    if str(failed):
        print(f"failed: {failed}", file=sys.stderr)
    if failed.above(allowed):
        raise Exit(1)

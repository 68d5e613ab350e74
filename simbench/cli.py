"""The command line: one verb, one function call."""

from __future__ import annotations

import json
import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

# before numpy is imported: on records of this size BLAS threads only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import typer

from detectors.errors import ParameterError, naming, nearest
from simbench.usage import exit_code

# typer has carried its own copy of click since 0.2x; its public error leads to the classes of whichever it uses
CommandError: Any = typer.BadParameter.__mro__[2]


def _workers(jobs: int) -> int:
    most = max(64, 4 * (os.cpu_count() or 1))
    if jobs == 0 or jobs < -1 or jobs > most:
        raise ParameterError(f"-j {jobs}; worker processes are 1 to {most}, or -1 for one on every core")
    return jobs


Json = Annotated[bool, typer.Option("--json", help="JSON, and nothing else, on stdout.")]
Jobs = Annotated[int, typer.Option("-j", "--jobs", callback=_workers, help="Worker processes; -1 = all cores.")]
Plugin = Annotated[list[Path] | None, typer.Option(metavar="FILE.py", help="File of a further detector; repeatable.")]
Limit = Annotated[float, typer.Option("--time-limit", metavar="S", help="Seconds a plug-in may take for a record or scenario.")]
ValvePlugin = Annotated[list[Path] | None, typer.Option(metavar="FILE.py", help="File of a further valve model; repeatable.")]
EffectPlugin = Annotated[list[Path] | None, typer.Option(metavar="FILE.py", help="File of a further effect; repeatable.")]
Thresholds = Annotated[
    Path | None, typer.Option(metavar="FILE.json", help="Other thresholds than the published ones, as calibrate writes them.")
]
Span = Annotated[tuple[float, float] | None, typer.Option(metavar="LO HI", help="Values that mean 0 and 100 %.")]

Power = Annotated[bool, typer.Option("--power", help="Also say what this record could have shown, from twins of its loop.")]
FrontEnd = Annotated[str, typer.Option(metavar="acf|hagglund", help="What says whether a loop oscillates.")]
World = Annotated[str, typer.Option(metavar="NAME", help="Independent simulator that draws the records.")]

# the help of each verb ends with its examples
EPILOG = {
    "simulate": ["simbench simulate loop.toml -o rec.csv --seed 1", "simbench simulate --from runs/ci --id ID -o rec.csv"],
    "valve": ["simbench valve --model choudhury --param S=5 --param J=2 op.csv -o mv.csv"],
    "predict": ["simbench predict loop.toml", "simbench predict loop.toml --json"],
    "detect": [
        "simbench detect rec.csv --kind flow --why",
        "simbench detect export.csv --columns op=FIC101.OUT,pv=FIC101.MEAS --html verdict.html",
        "simbench detect folder --labels records.csv --csv verdicts.csv",
    ],
    "diagnose": ["simbench diagnose rec.csv --kind flow --picture path.svg"],
    "trust": ["simbench trust rec.csv", "simbench trust rec.csv --loop loop.toml --html trust.html"],
    "report": ["simbench report folder -o plant.html"],
    "run": ["simbench run smoke -o runs/smoke", "simbench run chapter -o runs/chapter -j 2 --method fast,oracle --resume"],
    "score": ["simbench score runs/chapter --report report.html", "simbench score runs/new --compare runs/old"],
    "check": ["simbench check runs/ci --against results/baseline"],
    "history": ["simbench history results/baseline -o history.svg"],
    "calibrate": ["simbench calibrate chapter --false-alarm 0.05 -o cal"],
    "worst": ["simbench worst horch -o worst.toml --budget 500"],
    "figure": ["simbench figure fig-11-9 -o figures", "simbench figure all -o figures"],
    "gain-change": ["simbench confirm gain-change loop.toml"],
    "travel": ["simbench confirm travel loop.toml --picture travel.svg"],
    "gap diagnose": ["simbench gap diagnose rec.csv --baseline loop.toml --html gap.html --write-loop fixed.toml"],
    "leave-out": ["simbench gap leave-out withheld -j 2"],
    "study": ["simbench gap study folder --grid chapter --html study.html --write-grid fixed.toml"],
    "make": ["simbench gap withheld make check --key check.key --seed 1"],
    "answer": ["simbench gap withheld answer check -j 2"],
    "open": ["simbench gap withheld open check --key check.key"],
    "contract": ["simbench contract my_detector.py"],
    "list": ["simbench list detectors", "simbench list grids --json"],
}
_bare = {"add_completion": False, "no_args_is_help": True, "rich_markup_mode": None, "pretty_exceptions_enable": False}
app = typer.Typer(help="A closed-loop testbench for valve-stiction detectors.", **{**_bare, "add_completion": True})
confirm_app = typer.Typer(help="Is it the valve? The chapter's confirmation tests, on a simulated loop or on records.", **_bare)
gap_app = typer.Typer(help="Why is the simulation unlike the plant?", **_bare)
withheld_app = typer.Typer(help="The blind check of the gap diagnosis.", **_bare)
app.add_typer(confirm_app, name="confirm")


def _methods(incomplete: str) -> list[str]:
    from detectors.plugins.registry import methods

    return [name for name in ("all", "fast", "full", *methods.names(), *methods.lent) if name.startswith(incomplete)]


def _grids(incomplete: str) -> list[str]:
    from scenarios.grid import grid_names

    return [name for name in grid_names() if name.startswith(incomplete)]


app.add_typer(gap_app, name="gap")
gap_app.add_typer(withheld_app, name="withheld")


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(version("stiction-simbench"))
        raise typer.Exit


@app.callback()
def about(
    version: Annotated[bool, typer.Option("--version", is_eager=True, callback=_version, help="Print the version.")] = False,
) -> None:
    """A closed-loop testbench for valve-stiction detectors."""


@app.command()
def simulate(
    loop: Annotated[Path | None, typer.Argument(metavar="LOOP.toml", help="Loop file.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Record to write (CSV).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Root of all random numbers.")] = 0,
    kick: Annotated[float, typer.Option(help="Offset of OP at sample 0 (%).")] = 0.0,
    from_run: Annotated[Path | None, typer.Option("--from", metavar="RUN", help="Folder of a run.")] = None,
    scenario: Annotated[str | None, typer.Option("--id", help="Scenario of that run.")] = None,
    valve_plugin: ValvePlugin = None,
    effect_plugin: EffectPlugin = None,
    time_limit: Limit = 60.0,
) -> None:
    """Run one closed loop and write its record."""
    from simbench.files import refuse_own_input, write_record
    from simbench.loop.guest import guest_parts, simulated

    if (loop is None) == (from_run is None):
        raise ParameterError("simulate needs either a loop file, or --from RUN with --id ID")
    if out is None:
        raise ParameterError("simulate needs -o REC.csv, the record to write")
    if not abs(kick) <= 100.0:
        raise ParameterError(f"--kick {kick:g}; an offset of OP within -100 to 100 % is needed")
    refuse_own_input([out], [loop])
    with guest_parts(valve_plugin or [], effect_plugin or [], time_limit):
        if from_run is not None:
            from simbench.bench.store.reading import read_scenario

            if scenario is None:
                raise ParameterError("simulate --from RUN needs --id, the scenario to repeat")
            found = read_scenario(from_run, scenario)
            result = simulated(found.loop, found.seed, kick)
        else:
            from scenarios.spec import load_loop

            with naming(loop):
                result = simulated(load_loop(loop), seed, kick)
    write_record(result.record, out)
    r = result.record
    friction = "has friction" if result.sticky else "is without friction"
    print(f"{out}: {r.n} samples, Ts = {r.Ts:g} s, {r.duration:g} s; the valve {friction}")


@app.command()
def valve(
    source: Annotated[Path, typer.Argument(metavar="IN.csv", help="Table with a column op.")],
    model: Annotated[str, typer.Option(help="Valve model.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Table to write, with a column mv.")],
    param: Annotated[list[str] | None, typer.Option("--param", metavar="NAME=VALUE", help="Repeatable.")] = None,
    valve_plugin: ValvePlugin = None,
    time_limit: Limit = 60.0,
) -> None:
    """Send a column `op` through one valve model."""
    from simbench.files import refuse_own_input
    from simbench.loop.guest import guest_parts, response
    from simbench.loop.response import valve_file

    refuse_own_input([out], [source])
    with guest_parts(valve_plugin or [], seconds=time_limit):
        valve_file(source, out, model, _pairs(param or [], "--param"), response)


@app.command()
def predict(
    loop: Annotated[Path, typer.Argument(metavar="LOOP.toml")],
    as_json: Json = False,
) -> None:
    """Say what theory expects of a loop: table, describing function, exact cycle."""
    from scenarios.spec import load_loop
    from simbench.theory.predict import as_text
    from simbench.theory.predict import predict as theory

    with naming(loop):
        found = theory(load_loop(loop))
    _print(found if as_json else as_text(found), as_json)


@app.command()
def detect(
    path: Annotated[Path, typer.Argument(metavar="REC.csv|DIR", help="Record, or folder of records.")],
    method: Annotated[
        list[str] | None, typer.Option(metavar="ID", help="Method ids, all, fast or full; repeatable.", autocompletion=_methods)
    ] = None,
    process: Annotated[str | None, typer.Option(help="self-regulating or integrating.")] = None,
    kind: Annotated[str | None, typer.Option(help="flow, level, pressure, temperature or analyser.")] = None,
    op_span: Span = None,
    pv_span: Span = None,
    columns: Annotated[list[str] | None, typer.Option(metavar="op=NAME,pv=NAME", help="Which column is what.")] = None,
    Ts: Annotated[float | None, typer.Option("--ts", metavar="S", help="Sampling period (s), where no column says it.")] = None,
    loop: Annotated[str | None, typer.Option(metavar="N", help="Loop of a file with several: FIC101, chemicals.loop1.")] = None,
    labels: Annotated[Path | None, typer.Option(help="Table with id and label: judge and score its records.")] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Without the oscillation front end.")] = False,
    front_end: FrontEnd = "acf",
    plugin: Plugin = None,
    time_limit: Limit = 60.0,
    thresholds: Thresholds = None,
    power: Power = False,
    why: Annotated[bool, typer.Option("--why", help="Each method's reason below the table.")] = False,
    csv: Annotated[Path | None, typer.Option("--csv", metavar="FILE.csv", help="Table of the verdicts to write.")] = None,
    html: Annotated[Path | None, typer.Option("--html", metavar="FILE.html", help="Page to write.")] = None,
    as_json: Json = False,
) -> None:
    """Judge a record, or a folder of records, by one or all detectors."""
    from detectors.records.roles import column_pairs
    from detectors.report.report import failed, judge_files, table
    from simbench.files import refuse_kind, refuse_own_input

    refuse_kind(csv or "")
    refuse_own_input([csv, html], [path, labels, thresholds, *(plugin or [])])
    report = judge_files(
        path, method or ["all"], process=process, kind=kind, op_span=op_span, pv_span=pv_span, labels=labels, raw=raw,
        front_end=front_end, plugins=plugin or [], thresholds=_threshold_file(thresholds), columns=column_pairs(columns),
        Ts=Ts, loop=loop, time_limit=time_limit,
    )  # fmt: skip
    for name, sentence in report.refused.items():
        print(f"left out {name}: {sentence}", file=sys.stderr)
    for sentence in failed(report.verdicts):
        print(sentence, file=sys.stderr)
    if as_json and report.scores:
        print("\n".join(["score by unit:", *table(report.scores)]), file=sys.stderr)
    _print(report.as_json() if as_json else report.as_text(why=why, colour=sys.stdout.isatty()), as_json)
    if csv is not None:
        from simbench.files import whole_file

        with whole_file(csv) as f:
            report.to_frame().to_csv(f, index=False, lineterminator="\n")
    if html is not None:
        from simbench.plant.verdict_page import write_page

        write_page(report, html)
        print(f"page: {html.resolve()}", file=sys.stderr if as_json else sys.stdout)
    if power:
        _print_power(path, method or ["all"], as_json, process=process, kind=kind, op_span=op_span, pv_span=pv_span)


@app.command()
def diagnose(
    path: Annotated[Path, typer.Argument(metavar="REC.csv")],
    process: Annotated[str | None, typer.Option(help="self-regulating or integrating.")] = None,
    kind: Annotated[str | None, typer.Option(help="flow, level, pressure, temperature or analyser.")] = None,
    op_span: Span = None,
    pv_span: Span = None,
    picture: Annotated[Path | None, typer.Option(help="Picture of the path taken (SVG or PNG).")] = None,
    power: Power = False,
    as_json: Json = False,
) -> None:
    """Take one record through the chapter's whole diagnosis, step by step."""
    from detectors.procedure import diagnose as procedure
    from detectors.records.io import read_record
    from detectors.verdict import PROBABILITY
    from simbench.gap.stiction.friction import probability_of_stiction

    _picture(picture, path)
    record = read_record(path, process=process, kind=kind, op_span=op_span, pv_span=pv_span)
    diagnosis, p = procedure(record), probability_of_stiction(record)
    if picture is not None:
        from simbench.figures import draw_path

        draw_path(diagnosis, picture)
    said = "cannot be said" if p is None else f"{p:.2f}"
    text = f"{diagnosis.as_text()}\nProbability of stiction: {said}."
    _print(diagnosis.as_json() | {PROBABILITY: p} if as_json else text, as_json)
    if power:
        _print_power(path, ["all"], as_json, process=process, kind=kind, op_span=op_span, pv_span=pv_span)


@app.command("trust")
def trust_(
    path: Annotated[Path, typer.Argument(metavar="REC.csv")],
    loop: Annotated[Path | None, typer.Option(metavar="LOOP.toml", help="The loop; identified if absent.")] = None,
    method: Annotated[list[str] | None, typer.Option(metavar="ID", help="Method ids, all, fast or full; repeatable.")] = None,
    html: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Page to write.")] = None,
    process: Annotated[str | None, typer.Option(help="self-regulating or integrating.")] = None,
    kind: Annotated[str | None, typer.Option(help="flow, level, pressure, temperature or analyser.")] = None,
    op_span: Span = None,
    pv_span: Span = None,
    as_json: Json = False,
) -> None:
    """Say which detector to trust on this very loop, what it could have seen, and how probable stiction is."""
    from simbench.plant.command import trust_file

    about = {"process": process, "kind": kind, "op_span": op_span, "pv_span": pv_span}
    found = trust_file(path, loop, method or ["all"], html=html, **about)
    _print(found.as_json() if as_json else found.as_text(), as_json)


@app.command("report")
def report_(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Records of a plant's loops.")],
    labels: Annotated[Path | None, typer.Option(help="Table with id and label: judge its records.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Page; a CSV is written beside it.")] = Path("report.html"),
    jobs: Jobs = 2,
) -> None:
    """Put a plant's loops on one page, ranked by probability and size of stiction."""
    from simbench.plant.command import report_folder

    fleet, beside = report_folder(folder, out, labels, jobs=jobs)
    print(fleet.as_text())
    print(f"page: {out.resolve()}; table: {beside.resolve()}")


@app.command()
def run(
    grid: Annotated[str, typer.Argument(help="Name of a grid, or a TOML file.", autocompletion=_grids)],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder of the run, or a URL [runs/GRID].")] = None,
    jobs: Jobs = 1,
    method: Annotated[
        list[str] | None, typer.Option(metavar="ID", help="Method ids, fast, full, oracle; repeatable [fast, oracle].")
    ] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Only without the oscillation front end.")] = False,
    front_end: FrontEnd = "acf",
    plugin: Plugin = None,
    valve_plugin: ValvePlugin = None,
    effect_plugin: EffectPlugin = None,
    time_limit: Limit = 60.0,
    backend: Annotated[str, typer.Option(metavar="loky|dask|ray", help="Who works the pieces.")] = "loky",
    address: Annotated[str | None, typer.Option(metavar="URL", help="Of a running scheduler.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where an earlier run stopped.")] = False,
    until_width: Annotated[
        float | None, typer.Option(metavar="W", help="Add seeds until accuracy's interval is this narrow.")
    ] = None,
    sets: Annotated[list[str] | None, typer.Option("--set", metavar="K=V", help="Repeatable.")] = None,
    axis: Annotated[list[str] | None, typer.Option(metavar="K=a,b,c", help="Other values of an axis; repeatable.")] = None,
    thresholds: Thresholds = None,
    allow_failed: Annotated[
        float, typer.Option(metavar="SHARE", min=0.0, max=1.0, help="Of scenarios, or of a built-in method's records.")
    ] = 0.0,
    large: Annotated[bool, typer.Option("--large", help="Yes, more than a million scenarios.")] = False,
    as_json: Json = False,
) -> None:
    """Simulate a grid of scenarios, judge every record by every method, and score."""
    from simbench.bench.execute.failures import read_failures
    from simbench.bench.execute.run import Interrupted, run_grid
    from simbench.bench.scenario.oracle import ORACLE
    from simbench.bench.score.scoring import score_run

    axes = {k: [_number(v) for v in str(values).split(",")] for k, values in _pairs(axis or [], "--axis", text=True).items()}
    try:
        folder = run_grid(
            grid, out or Path("runs") / Path(grid).stem, tuple(method or ["fast", ORACLE]), jobs, raw=raw,
            front_end=front_end, plugins=plugin or [],
            backend=backend, address=address, resume=resume, until_width=until_width, sets=_pairs(sets or [], "--set"),
            axes=axes, thresholds=_threshold_file(thresholds), large=large, time_limit=time_limit,
            valve_plugins=valve_plugin or [], effect_plugins=effect_plugin or [],
        )  # fmt: skip
    except Interrupted as stop:  # said here: the command-line library turns Ctrl-C into a bare exit code
        print(stop, file=sys.stderr)
        raise typer.Exit(130) from None
    scores, failed = score_run(folder, raw=raw), read_failures(folder)
    told = {"run": str(folder), "failed": failed.as_json(), **scores.as_json()}
    _print(told if as_json else f"{scores.as_text()}\n\n{_line(failed)}run: {folder}", as_json)
    if failed.above(allow_failed):
        print(f"failed: {failed}", file=sys.stderr)
        raise typer.Exit(1)


@app.command()
def score(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    raw: Annotated[bool, typer.Option("--raw", help="Verdicts without the oscillation front end.")] = False,
    report: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Report with pictures to write.")] = None,
    against: Annotated[Path | None, typer.Option("--compare", metavar="RUN", help="A second run, paired by scenario.")] = None,
    paired: Annotated[bool, typer.Option("--paired", help="Compare this run's methods with each other, paired.")] = False,
    as_json: Json = False,
) -> None:
    """Score a run: accuracy, no-decision rate, AUC, with intervals, by grid axis."""
    from simbench.bench.execute.failures import read_failures
    from simbench.bench.score.scoring import score_run
    from simbench.files import refuse_own_input

    refuse_own_input([report], [folder, against])
    scores, failed = score_run(folder, raw=raw), read_failures(folder)
    content: Any = {**scores.as_json(), "failed": failed.as_json()} if as_json else f"{_line(failed)}{scores.as_text()}"
    if against is not None or paired:
        from simbench.bench.score.compare import compare

        comparison = compare(folder, against, raw=raw)
        content = {**content, "comparison": comparison.as_json()} if as_json else f"{content}\n\n{comparison.as_text()}"
    _print(content, as_json)
    if report is not None:
        from simbench.report import write_report

        write_report(folder, report)
        print(f"report: {report.resolve()}", file=sys.stderr if as_json else sys.stdout)


@app.command()
def check(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    against: Annotated[Path, typer.Option(metavar="DIR", help="Baseline.")],
    junit: Annotated[Path | None, typer.Option(metavar="FILE.xml", help="JUnit summary to write.")] = None,
    markdown: Annotated[Path | None, typer.Option(metavar="FILE.md", help="Markdown summary to write.")] = None,
    update: Annotated[bool, typer.Option("--update", help="Make this run the baseline, and show the difference.")] = False,
    margin: Annotated[float, typer.Option(min=0.0, max=1.0, help="A rate may fall by this much.")] = 0.01,
    as_json: Json = False,
) -> None:
    """Compare a run with a baseline; exit 1 when accuracy regressed."""
    from simbench.bench.score.check import check_run, update_baseline
    from simbench.files import refuse_own_input, whole_file

    refuse_own_input([junit, markdown], [folder, against])
    if update:
        print(update_baseline(folder, against))
        return
    result = check_run(folder, against, margin)
    for path, text in ((junit, result.as_junit()), (markdown, result.as_markdown())):
        if path is not None:
            with whole_file(path) as f:
                f.write(text)
    _print(result.as_json() if as_json else result.as_text(), as_json)
    if result.failed:
        raise typer.Exit(1)


@app.command()
def history(
    baseline: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a baseline.")] = Path("results/baseline"),
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="FILE.svg", help="Picture to write.")] = None,
    as_json: Json = False,
) -> None:
    """Show how accuracy moved over the baselines kept."""
    from simbench.bench.score.history import read_history

    _picture(out)
    found = read_history(baseline)
    if out is not None:
        from simbench.figures import draw_history

        draw_history(found, out)
    _print(found.as_json() if as_json else found.as_text(), as_json)


@app.command()
def calibrate(
    grid: Annotated[str, typer.Argument(help="Name of a grid, or a TOML file.")],
    false_alarm: Annotated[float, typer.Option(help="Wanted share of healthy loops called sticky.")] = 0.05,
    method: Annotated[list[str] | None, typer.Option(metavar="ID", help="Method ids, fast or full; repeatable.")] = None,
    jobs: Jobs = 1,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for thresholds and ROC curves.")] = None,
    as_json: Json = False,
) -> None:
    """Find each method's threshold for a wanted false-alarm rate."""
    from simbench.bench.calibrate import calibrate as run_calibration

    found = run_calibration(grid, false_alarm, tuple(method or ["fast"]), jobs, out=out)
    _print(found.as_json() if as_json else found.as_text(), as_json)


@app.command()
def worst(
    method: Annotated[str, typer.Argument(help="Method id.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Loop file to write.")] = None,
    budget: Annotated[int, typer.Option(min=1, help="Loops to try.")] = 2000,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    as_json: Json = False,
) -> None:
    """Search the healthy loop on which a method is most confidently wrong."""
    from simbench.bench.worst import worst as search
    from simbench.files import whole_file

    found = search(method, budget=budget, seed=seed)
    if out is not None:
        with whole_file(out) as f:
            f.write(found.to_toml())
    _print(found.as_json() if as_json else found.as_text(), as_json)


@app.command()
def figure(
    ids: Annotated[list[str], typer.Argument(metavar="ID|all", help="Figure ids.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write to.")],
    run_folder: Annotated[Path | None, typer.Option("--run", metavar="RUN", help="Run for the figures that show one.")] = None,
    isdb: Annotated[Path | None, typer.Option(metavar="FILE|DIR", help="Real records.")] = None,
    as_json: Json = False,
) -> None:
    """Draw the chapter's figures and tables, each with the numbers drawn beside it."""
    from simbench.figures import make_figures

    drawn = make_figures(ids, out, run=run_folder, isdb=isdb)
    rows = [{"id": d.id, "files": [str(f) for f in d.files], "left_out": d.left_out} for d in drawn]
    _print(rows if as_json else "\n".join(f"{r['id']}: {r['left_out'] or ', '.join(r['files'])}" for r in rows), as_json)


@confirm_app.command("gain-change")
def gain_change(
    loop: Annotated[Path | None, typer.Argument(metavar="LOOP.toml")] = None,
    records: Annotated[tuple[Path, Path] | None, typer.Option(metavar="BEFORE.csv AFTER.csv", help="Not a loop.")] = None,
    ratio: Annotated[
        float | None,
        typer.Option("--ratio", "--factor", metavar="R", help="New gain over old; read off the records when absent."),
    ] = None,
    op_span: Span = None,
    picture: Annotated[Path | None, typer.Option(help="Picture to write (SVG or PNG).")] = None,
    as_json: Json = False,
) -> None:
    """Does the period follow the controller gain?"""
    _one_of("confirm gain-change", loop, "--records BEFORE.csv AFTER.csv", records)
    _picture(picture, loop, *(records or ()))
    if loop is None:
        from detectors.records.io import read_record
        from simbench.confirm.recorded import gain_change_recorded

        assert records is not None
        before, after = (read_record(path, op_span=op_span) for path in records)
        found = gain_change_recorded(before, after, ratio)
    else:
        from scenarios.spec import load_loop
        from simbench.confirm.gain_change import gain_change as test

        with naming(loop):
            found = test(load_loop(loop)) if ratio is None else test(load_loop(loop), ratio)
    _confirmed(found, picture, as_json)


@confirm_app.command()
def travel(
    loop: Annotated[Path | None, typer.Argument(metavar="LOOP.toml")] = None,
    record: Annotated[Path | None, typer.Option(metavar="REC.csv", help="Of such a test, in place of a loop.")] = None,
    process: Annotated[str | None, typer.Option(help="Of the record: self-regulating or integrating.")] = None,
    op_span: Span = None,
    picture: Annotated[Path | None, typer.Option(help="Picture to write (SVG or PNG).")] = None,
    as_json: Json = False,
) -> None:
    """Valve travel test: small steps of OP until PV moves, same direction and reversed; a loop is graded by Table 11.1."""
    _one_of("confirm travel", loop, "--record REC.csv", record)
    _picture(picture, loop, record)
    if loop is None:
        from detectors.records.io import read_record
        from simbench.confirm.recorded import travel_recorded

        assert record is not None
        found = travel_recorded(read_record(record, process=process, op_span=op_span))
    else:
        from scenarios.spec import load_loop
        from simbench.confirm.grade import graded_test

        with naming(loop):
            found = graded_test(load_loop(loop))
    _confirmed(found, picture, as_json)


@gap_app.command("diagnose")
def gap_diagnose(
    records: Annotated[list[Path], typer.Argument(metavar="REC.csv ...", help="Records of one loop, judged together.")],
    baseline: Annotated[
        Path | None,
        typer.Option(metavar="LOOP.toml", help="The simulation that does not fit; [plant] or [controller] may be missing."),
    ] = None,
    identify: Annotated[bool, typer.Option("--identify", help="No baseline: estimate one from the record.")] = False,
    jobs: Jobs = 1,
    no_bootstrap: Annotated[bool, typer.Option("--no-bootstrap", hidden=True)] = False,
    html: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Report to write.")] = None,
    write_loop: Annotated[Path | None, typer.Option(metavar="FIXED.toml", help="Loop file with the effect in it.")] = None,
    picture: Annotated[Path | None, typer.Option(help="The diagnosis on one sheet (SVG, PNG or PDF).")] = None,
    process: Annotated[str | None, typer.Option(help="self-regulating or integrating; for --identify.")] = None,
    op_span: Span = None,
    window: Annotated[tuple[int, int] | None, typer.Option(metavar="FROM TO", help="Samples to judge.")] = None,
    as_json: Json = False,
) -> None:
    """Say where record and simulation differ, which effect explains it, and how far it shrinks."""
    from simbench.gap.command import diagnose_files

    if (baseline is None) == (not identify):
        raise ParameterError("gap diagnose needs either --baseline LOOP.toml or --identify")
    report = diagnose_files(
        records, baseline, jobs=jobs, html=html, write_loop=write_loop, picture=picture,
        process=process, op_span=op_span, window=window,
    )  # fmt: skip
    _print(report.as_json() if as_json else report.as_text(), as_json)


@gap_app.command("leave-out")
def leave_out_(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for records, table and picture.")],
    world: World = "own",
    n: Annotated[int, typer.Option("-n", "--records", min=1, help="Records per effect.")] = 4,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Jobs = 1,
    as_json: Json = False,
) -> None:
    """Take every effect out of the library in turn: what is said then, and how far the gap shrinks once it is back."""
    from simbench.blind.leave_out import leave_out, summary

    table = summary(leave_out(out, world, n, seed, jobs))
    text = table.to_string(index=False, float_format="%.2f", na_rep="-")
    _print(json.loads(table.to_json(orient="records")) if as_json else text, as_json)


@gap_app.command("study")
def gap_study(
    records: Annotated[Path, typer.Argument(metavar="RECORDS", help="Folder of records.")],
    grid: Annotated[str, typer.Option(help="Name of a grid, or a TOML file.")],
    labels: Annotated[Path | None, typer.Option(help="Table with id and label: its records, by unit.")] = None,
    html: Annotated[Path | None, typer.Option(metavar="FILE.html", help="Page to write; a killed call goes on.")] = None,
    write_grid: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="The grid, with the effects found.")] = None,
    jobs: Jobs = 2,
    as_json: Json = False,
) -> None:
    """Say what separates a set of records from a grid, which effects explain it, and what each costs each detector."""
    from simbench.plant.command import study_folder

    found = study_folder(records, grid, labels, html=html, write_grid=write_grid, jobs=jobs)
    _print(found.as_json() if as_json else found.as_text(), as_json)


@withheld_app.command()
def make(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the check.")],
    key: Annotated[Path, typer.Option(help="File for the key to the answers, outside DIR.")],
    seed: Annotated[int, typer.Option(min=0)],
    n: Annotated[int, typer.Option("-n", "--records", min=100, help="About how many records.")] = 600,
    jobs: Jobs = 1,
    world: World = "own",
) -> None:
    """Write shuffled records with hidden effects, and seal the answers."""
    from simbench.blind.making import make as write

    print(write(out, key, seed, n=n, jobs=jobs, world=world))


@withheld_app.command()
def answer(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the check.")],
    jobs: Jobs = 1,
    no_bootstrap: Annotated[bool, typer.Option("--no-bootstrap", hidden=True)] = False,
    world: World = "own",
) -> None:
    """Diagnose every record, without sight of the answers and whatever the world; resumes where it stopped."""
    from simbench.blind.answering import answer as diagnose_all
    from simbench.gap.command import one_file

    print(f"{diagnose_all(out, one_file, jobs)} records diagnosed")


@withheld_app.command("open")
def open_sealed(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the check.")],
    key: Annotated[Path | None, typer.Option(help="Key file; not needed where answers.csv lies open.")] = None,
    scores: Annotated[Path | None, typer.Option("--scores", metavar="DIR", help="Where the scores go.")] = None,
    world: World = "own",
    as_json: Json = False,
) -> None:
    """Score the answers against the truth."""
    from simbench.blind.opening import open_ as score_answers

    found = score_answers(out, key, scores, world)
    _print({k: v for k, v in found.items() if k != "markdown"} if as_json else found["markdown"], as_json)


@app.command()
def contract(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="A detector, valve, effect, recogniser (.py) or grid (.toml).")],
    as_json: Json = False,
) -> None:
    """Check whether a plug-in keeps its contract; exit 1 when it does not."""
    from simbench.contract.apart import check_apart

    found = check_apart(path)
    _print(found.as_json() if as_json else found.as_text(), as_json)
    if not found.kept:
        raise typer.Exit(1)


@app.command("list")
def list_(
    what: Annotated[str, typer.Argument(help="detectors, valves, grids, effects or figures.")],
    as_json: Json = False,
) -> None:
    """List what there is, one line and source each."""
    from simbench.catalogue import KINDS, catalogue

    if what not in KINDS:
        raise ParameterError(f"nothing to list under {what!r}: {nearest(what, KINDS)}")
    rows = catalogue(what)
    width = max((len(r["name"]) for r in rows), default=0)
    _print(rows if as_json else "\n".join(f"{r['name']:<{width}}  {r['says']} [{r['source']}]" for r in rows), as_json)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : list of str, optional
        In place of sys.argv.

    Returns
    -------
    int
        0 done, 1 a gate failed, 2 wrong usage, file or configuration (said in one sentence on stderr), 130 interrupted.
    """
    return exit_code(lambda: _command(arguments))


def entry() -> None:
    """Console script."""
    sys.exit(main())


def _with_examples(group: Any, path: str = "") -> None:
    """Put its examples below the help of every verb, unwrapped."""
    for name, command in group.commands.items():
        lines = EPILOG.get(f"{path}{name}") or EPILOG.get(name)
        if hasattr(command, "commands"):
            _with_examples(command, f"{name} ")
        elif lines:
            command.epilog = "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def _command(arguments: list[str] | None) -> int | None:
    command = typer.main.get_command(app)
    _with_examples(command)
    try:
        return command.main(args=arguments, prog_name="simbench", standalone_mode=False)
    except CommandError as error:
        raise ParameterError(_usage(error, sys.argv[1:] if arguments is None else arguments)) from None
    except typer.Abort as error:
        raise KeyboardInterrupt(str(error)) from None


def _usage(error: Any, arguments: list[str]) -> str:
    message = error.format_message().strip()
    if message.startswith("Invalid value for "):
        # the sentence names the option and what is allowed, not what was given
        option, _, allowed = message.partition(": ")
        given = [v for k, v in pairwise(arguments) if k.lstrip("-") and f"'{k}'" in option]
        message = f"{option}: {given[0][:80]!r}: {allowed}" if given else message
    context = getattr(error, "ctx", None)
    if "unexpected extra argument" in message and context is not None:
        message += f"; allowed: {' '.join(context.command.collect_usage_pieces(context))}"
    if message.startswith("Usage:"):
        return "a verb is missing: " + ", ".join(_verbs(context))
    if "such command" in message and "mean" not in message:
        message += f" Known: {', '.join(_verbs(context))}"
    return message[0].lower() + message[1:]


def _verbs(context: Any) -> list[str]:
    return [] if context is None else context.command.list_commands(context)


def _line(failed: Any) -> str:
    return f"failed: {failed}\n\n" if str(failed) else ""


def _one_of(verb: str, loop: Path | None, option: str, other: Any) -> None:
    if (loop is None) == (other is None):
        raise ParameterError(f"{verb} needs either a loop file, or {option}")


def _confirmed(result: Any, picture: Path | None, as_json: bool) -> None:
    if picture is not None:
        from simbench.figures._style import write_picture

        write_picture(result.plot(), picture)
    _print(result.as_json() if as_json else result.as_text(), as_json)


def _picture(path: Path | None, *read: Path | None) -> None:
    """Refuse, before any work, a picture that would stand in place of what is read, or is of no known kind."""
    from simbench.files import picture_kind, refuse_own_input

    refuse_own_input([path], read)
    if path is not None:
        picture_kind(path)


def _threshold_file(path: Path | None) -> dict[str, dict[str, float]]:
    if path is None:
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"thresholds {path} cannot be read: {(error.strerror or str(error)).lower()}") from None
    except (ValueError, RecursionError) as error:
        said = " ".join(str(error).split())[:200]
        raise ParameterError(f"thresholds {path} are no JSON ({said}); a table of method ids is needed") from None
    if not isinstance(found, dict) or not all(isinstance(v, dict) for v in found.values()):
        raise ParameterError(f"thresholds {path}: a table of method ids to tables of numbers is needed")
    for method, values in found.items():
        for name, value in values.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 1e60:
                raise ParameterError(f"thresholds {path}: {method}.{name} = {str(value)[:60]!r}; a finite number is needed")
    return found


def _print_power(path: Path, methods: list[str], as_json: bool, **about: Any) -> None:
    from simbench.plant.command import power_lines

    # beside JSON nothing else may stand on stdout
    print("\n".join(power_lines(path, methods, **about)), file=sys.stderr if as_json else sys.stdout)


def _pairs(words: list[str], option: str, text: bool = False) -> dict[str, Any]:
    pairs = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ParameterError(f"{option} {word!r}: NAME=VALUE is needed")
        if name in pairs:
            raise ParameterError(f"{option} {word!r}: {name} = {pairs[name]} was given already; once is allowed")
        pairs[name] = value if text else _number(value)
    return pairs


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def _print(content: Any, as_json: bool) -> None:
    print(json.dumps(content, indent=1, allow_nan=False) if as_json else content)
    sys.stdout.flush()


if __name__ == "__main__":
    entry()

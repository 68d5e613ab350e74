"""Why is the simulation unlike the plant? And the blind check of what answers that."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from detectors.errors import ParameterError
from simbench.cli.common import (
    EffectPlugin,
    Jobs,
    Json,
    Page,
    Seed,
    World,
    examples,
    gap_app,
    pairs,
    reads,
    show,
    show_result,
    withheld_app,
)

Baseline = Annotated[Path, Option(metavar="LOOP.toml", help="The simulation that does not fit.")]
LoopTest = Annotated[
    list[str] | None,
    Option(
        metavar="REC.csv[:SETTINGS.toml]",
        help="A test of the same loop in other operation; repeatable.",
    ),
]
Check = Annotated[Path, Argument(metavar="DIR", help="Folder of the check.")]
NoBootstrap = Annotated[bool, Option("--no-bootstrap", hidden=True)]


@gap_app.command(
    "diagnose",
    epilog=examples(
        "gap diagnose rec.csv --baseline loop.toml --html gap.html --write-loop fixed.toml"
    ),
)
@reads()
def gap_diagnose(
    records: Annotated[
        list[Path], Argument(metavar="REC.csv ...", help="Records of one loop, judged together.")
    ],
    baseline: Annotated[
        Path | None,
        Option(
            metavar="LOOP.toml",
            help="The simulation that does not fit; [plant] or [controller] may be missing.",
        ),
    ] = None,
    identify: Annotated[
        bool, Option("--identify", help="No baseline: estimate one from the record.")
    ] = False,
    test: LoopTest = None,
    jobs: Jobs = 1,
    no_bootstrap: NoBootstrap = False,
    html: Annotated[Path | None, Option(metavar="FILE.html", help="Report to write.")] = None,
    write_loop: Annotated[
        Path | None, Option(metavar="FIXED.toml", help="Loop file with the effect in it.")
    ] = None,
    picture: Annotated[
        Path | None, Option(help="The diagnosis on one sheet (SVG, PNG or PDF).")
    ] = None,
    effect_plugin: EffectPlugin = None,
    window: Annotated[
        tuple[int, int] | None, Option(metavar="FROM TO", help="Samples to judge.")
    ] = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Say where record and simulation differ, which effect explains it, and how far it shrinks."""
    from simbench.gap.command import DiagnosisFiles, diagnose_files

    if (baseline is None) == (not identify):
        raise ParameterError("gap diagnose needs either --baseline LOOP.toml or --identify")
    report = diagnose_files(
        records,
        baseline,
        jobs=jobs,
        wanted=DiagnosisFiles(html, write_loop, picture),
        window=window,
        tests=test or (),
        effect_plugins=effect_plugin or (),
        **about,
    )
    show_result(report, as_json)


@gap_app.command(
    "plan",
    epilog=examples("gap plan rec.csv --baseline loop.toml --limits limits.toml --html plan.html"),
)
@reads()
def gap_plan(
    record: Annotated[
        Path, Argument(metavar="REC.csv", help="The record that is not yet explained.")
    ],
    baseline: Baseline,
    limits: Annotated[
        Path | None, Option(metavar="LIMITS.toml", help="What a test may do to PV, OP and time.")
    ] = None,
    test: Annotated[
        list[str] | None,
        Option(metavar="REC.csv[:SETTINGS.toml]", help="A test that was run already; repeatable."),
    ] = None,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Say which test to run next: what it would tell, its size, how long it lasts and what it does
    to the plant.
    """
    from simbench.gap.command import plan_files

    plan = plan_files(record, baseline, limits=limits, tests=test or (), html=html, **about)
    show_result(plan, as_json)


@gap_app.command(
    "predict", epilog=examples("gap predict rec.csv --baseline loop.toml --set controller.Kc=2")
)
@reads()
def gap_predict(
    record: Annotated[Path, Argument(metavar="REC.csv", help="Record of the loop as it runs now.")],
    baseline: Annotated[
        Path, Option(metavar="LOOP.toml", help="The simulation that is diagnosed and corrected.")
    ],
    settings: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="KEY=VALUE",
            help="Setting of controller or setpoint to change; repeatable.",
        ),
    ] = None,
    test: LoopTest = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Predict what PV and OP will do under other settings, with 90 % intervals and whether the
    record supports them.
    """
    from simbench.gap.command import predict_file

    prediction = predict_file(
        record, baseline, pairs(settings or [], "--set", text=True), tests=test or (), **about
    )
    show_result(prediction, as_json)


@gap_app.command(
    "discover",
    epilog=examples(
        "gap discover rec.csv --baseline loop.toml --write-effect my_law.py --html law.html"
    ),
)
@reads()
def gap_discover(
    record: Annotated[Path, Argument(metavar="REC.csv", help="Record of the loop.")],
    baseline: Baseline,
    write_effect: Annotated[
        Path | None, Option(metavar="FILE.py", help="The law as an effect to simulate.")
    ] = None,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Describe by a law what the simulation lacks and no known effect names: where, how, with what
    certificate.
    """
    from simbench.gap.command import discover_file

    discovery = discover_file(record, baseline, write_effect=write_effect, html=html, **about)
    show_result(discovery, as_json)


@gap_app.command("leave-out", epilog=examples("gap leave-out withheld -j 2"))
def leave_out_(
    out: Annotated[Path, Argument(metavar="DIR", help="Folder for records and table.")],
    world: World = "own",
    n: Annotated[int, Option("-n", "--records", min=1, help="Records per effect.")] = 4,
    seed: Seed = 0,
    tests: Annotated[
        int, Option(min=0, metavar="N", help="Tests a record that the diagnosis may ask for.")
    ] = 0,
    jobs: Jobs = 1,
    as_json: Json = False,
) -> None:
    """Take every effect out of the library in turn: what is diagnosed then, and how far the
    gap shrinks once it is back.
    """
    from simbench.blind.leave_out import leave_out, summary

    table = summary(leave_out(out, world, n, seed, jobs, tests))
    text = table.to_string(index=False, float_format="%.2f", na_rep="-")
    show(json.loads(table.to_json(orient="records")) if as_json else text, as_json)


@gap_app.command(
    "study",
    epilog=examples("gap study folder --grid chapter --html study.html --write-grid fixed.toml"),
)
def gap_study(
    records: Annotated[Path, Argument(metavar="RECORDS", help="Folder of records.")],
    grid: Annotated[str, Option(help="Name of a grid, or a TOML file.")],
    labels: Annotated[
        Path | None, Option(help="Table with id and label: its records, by unit.")
    ] = None,
    html: Annotated[
        Path | None, Option(metavar="FILE.html", help="Page to write; a killed call goes on.")
    ] = None,
    write_grid: Annotated[
        Path | None, Option(metavar="FILE.toml", help="The grid, with these effects.")
    ] = None,
    jobs: Jobs = 2,
    as_json: Json = False,
) -> None:
    """Say what separates a set of records from a grid, which effects explain it, and what each
    costs each detector.
    """
    from simbench.plant.command import study_folder

    study = study_folder(records, grid, labels, html=html, write_grid=write_grid, jobs=jobs)
    show_result(study, as_json)


@withheld_app.command(epilog=examples("gap withheld make check --key check.key --seed 1"))
def make(
    out: Check,
    key: Annotated[Path, Option(help="File for the key to the answers, outside DIR.")],
    seed: Seed,
    n: Annotated[int, Option("-n", "--records", min=100, help="About how many records.")] = 600,
    jobs: Jobs = 1,
    world: World = "own",
    tests: Annotated[
        bool, Option("--tests", help="With what every test of the menu would show of each record.")
    ] = False,
) -> None:
    """Write shuffled records with hidden effects, and seal the answers."""
    from simbench.blind.making import make as write

    print(write(out, key, seed, n=n, jobs=jobs, world=world, tests=tests))


@withheld_app.command(epilog=examples("gap withheld answer check -j 2"))
def answer(
    out: Check,
    jobs: Jobs = 1,
    no_bootstrap: NoBootstrap = False,
    world: World = "own",
    tests: Annotated[
        int, Option(metavar="N", help="Tests a record that the diagnosis may ask for, 0 to 2.")
    ] = 0,
) -> None:
    """Diagnose every record, without sight of the answers and whatever the world; resumes where it
    stopped.
    """
    from simbench.blind.answering import answer as diagnose_all
    from simbench.gap.command import one_file

    print(f"{diagnose_all(out, one_file, jobs, tests)} records diagnosed")


@withheld_app.command("open", epilog=examples("gap withheld open check --key check.key"))
def open_sealed(
    out: Check,
    key: Annotated[
        Path | None, Option(help="Key file; not needed where answers.csv lies open.")
    ] = None,
    scores: Annotated[
        Path | None, Option("--scores", metavar="DIR", help="Where the scores go.")
    ] = None,
    world: World = "own",
    as_json: Json = False,
) -> None:
    """Score the answers against the truth."""
    from simbench.blind.opening import open_ as score_answers

    scored = score_answers(out, key, scores, world)
    show(
        {k: v for k, v in scored.items() if k != "markdown"} if as_json else scored["markdown"],
        as_json,
    )

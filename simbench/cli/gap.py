"""The verbs of `simbench gap`: explain why a simulation differs from the plant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from simbench.cli.common import (
    EffectPlugin,
    Jobs,
    Json,
    Page,
    Seed,
    examples,
    gap_app,
    grid_completion,
    method_completion,
    reads,
    say,
    show_result,
)
from simbench.detectors.errors import ParameterError

Baseline = Annotated[
    Path, Option(metavar="LOOP.toml", help="Compare with the simulation in this loop file.")
]
Identify = Annotated[
    bool,
    Option(
        "--identify",
        help="Estimate the simulation from the record instead of reading a loop file.",
    ),
]
Healthy = Annotated[
    list[Path] | None,
    Option(
        metavar="REC.csv",
        help="Take what is ordinary of noise and load from this record of healthy operation, of the"
        " same loop or a sibling; may be repeated.",
    ),
]
NoBootstrap = Annotated[bool, Option("--no-bootstrap", hidden=True)]


@gap_app.command(
    "diagnose",
    epilog=examples(
        "gap diagnose rec.csv --baseline loop.toml --html gap.html --write-loop fixed.toml"
    ),
)
@reads
def gap_diagnose(
    records: Annotated[
        list[Path],
        Argument(
            metavar="REC.csv ...|FOLDER ...",
            help="Read these records of one loop, which are judged together; or folders, each"
            " record of which is judged by itself, once where it is in several.",
        ),
    ],
    baseline: Annotated[
        Path | None,
        Option(
            metavar="LOOP.toml",
            help=(
                "Compare with the simulation in this loop file; [plant] or [controller] may be "
                "missing."
            ),
        ),
    ] = None,
    identify: Identify = False,
    healthy: Healthy = None,
    jobs: Jobs = 1,
    no_bootstrap: NoBootstrap = False,
    html: Annotated[
        Path | None, Option(metavar="FILE.html", help="Write an HTML report to this file.")
    ] = None,
    write_loop: Annotated[
        Path | None,
        Option(
            metavar="FIXED.toml",
            help="Write a loop file that models the missing effect; of an identified loop its"
            " residuals stand beside it, in FIXED.columns.csv.",
        ),
    ] = None,
    picture: Annotated[
        Path | None, Option(help="Draw the diagnosis on one sheet to this file (SVG, PNG or PDF).")
    ] = None,
    effect_plugin: EffectPlugin = None,
    window: Annotated[
        tuple[int, int] | None,
        Option(metavar="FROM TO", help="Judge only these samples (first and last)."),
    ] = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Report where record and simulation differ, and which missing effect explains it.

    The gap is the distance between the record and simulations of the loop file. The output states
    it with the model as given, with the parameters K, T and Td of the plant fitted again, and with
    the missing effect added. The repeatability floor is the distance between two simulations that
    differ only in their seeds; no model comes nearer. The table lists the effects with their
    probabilities and estimated parameters.

    Files need --baseline or --identify. Of a folder every record is diagnosed by itself, and the
    effects are counted; without either option each is compared with the loop file of its name
    beside it, and identified where there is none. What cannot be diagnosed is listed with its
    reason, and the exit code is 1.
    """
    from simbench.gap.command import DiagnosisFiles, diagnose_files

    if any(record.is_dir() for record in records):
        for option, value in (
            ("--write-loop", write_loop),
            ("--picture", picture),
            ("--healthy", healthy),
            ("--window", window),
            ("--effect-plugin", effect_plugin),
        ):
            if value:
                raise ParameterError(f"{option} is for the records of one loop, not for a folder")
        for record in records:
            if not record.is_dir():
                raise ParameterError(
                    f"gap diagnose: {record} is no folder; either records or folders are needed"
                )
        _diagnose_folders(records, baseline, identify, jobs, html, as_json, about)
        return
    _refuse_both("gap diagnose", baseline, identify)
    report = diagnose_files(
        records,
        baseline,
        jobs=jobs,
        wanted=DiagnosisFiles(html, write_loop, picture),
        window=window,
        healthy=healthy or (),
        effect_plugins=effect_plugin or (),
        **about,
    )
    show_result(report, as_json)


def _refuse_both(verb: str, baseline: Path | None, identify: bool) -> None:
    """Refuse a loop file beside --identify, and neither of them."""
    if (baseline is None) == (not identify):
        raise ParameterError(f"{verb} needs either --baseline LOOP.toml or --identify")


def _diagnose_folders(
    folders: list[Path],
    baseline: Path | None,
    identify: bool,
    jobs: int,
    html: Path | None,
    as_json: bool,
    about: dict,
) -> None:
    from simbench.files import refuse_own_input
    from simbench.gap.folder import diagnose_folder

    refuse_own_input([html], [*folders, baseline])
    if baseline is not None:
        _refuse_both("gap diagnose", baseline, identify)
    found = diagnose_folder(folders, baseline, jobs, identify=identify, **about)
    show_result(found, as_json)
    if html is not None:
        found.write_page(html)
        say(f"page: {html.resolve()}", as_json)
    if found.refused:
        raise Exit(1)


@gap_app.command(
    "grid",
    epilog=examples(
        "gap grid chapter records -j 4 --html gap.html",
        "gap grid own.toml records --labels records.csv --json",
    ),
)
@reads
def gap_grid(
    grid: Annotated[
        str,
        Argument(
            metavar="GRID",
            help="Name a grid, or give a TOML file, or the folder of a run.",
            autocompletion=grid_completion,
        ),
    ],
    folder: Annotated[
        Path, Argument(metavar="FOLDER", help="Read the records of this folder, at least 10.")
    ],
    method: Annotated[
        list[str] | None,
        Option(
            metavar="ID",
            help="Compare the accuracy of these methods: ids, or the groups fast and full; may be"
            " repeated [fast].",
            autocompletion=method_completion,
        ),
    ] = None,
    n: Annotated[int, Option(metavar="N", help="Draw this many loops from the grid.")] = 130,
    labels: Annotated[
        Path | None,
        Option(
            metavar="TABLE.csv",
            help="Read from this table (columns id, label and unit_group) which records are of one"
            " unit; a classifier that has learned one is not asked about another.",
        ),
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = 1,
    html: Page = None,
    picture: Annotated[
        Path | None, Option(help="Draw the answer to this file (SVG, PNG or PDF).")
    ] = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Report how a grid differs from a folder of records, and which effect it lacks.

    A classifier learns to tell records from simulations by features that have no unit; it is asked
    about units that it has not seen. The area under its ROC curve (AUC) is 1 where any record can
    be told from the grid, and 0.5 where none can. Effects of the library are added to every loop
    of the grid, one at a time and together, to see which of them brings the AUC down, and what it
    costs each detector.

    It takes a few minutes; -j 2 halves them.
    """
    from simbench.gap.command import grid_files

    found = grid_files(
        grid,
        folder,
        labels=labels,
        html=html,
        picture=picture,
        methods=method or ["fast"],
        n=n,
        seed=seed,
        jobs=jobs,
        **about,
    )
    show_result(found, as_json)

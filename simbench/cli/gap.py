"""The verbs of `simbench gap`: explain why a simulation differs from the plant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from simbench.cli.common import (
    EffectPlugin,
    Jobs,
    Json,
    Seed,
    examples,
    gap_app,
    grid_completion,
    reads,
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
            metavar="REC.csv ...",
            help="Read these records of one loop, which are judged together.",
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
    """
    from simbench.gap.command import DiagnosisFiles, diagnose_files

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


@gap_app.command(
    "grid",
    epilog=examples(
        "gap grid chapter records -j 4 --picture gap.svg",
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
    of the grid, one at a time and together, to see which of them brings the AUC down.

    It takes a minute or two; -j 2 halves them.
    """
    from simbench.gap.command import grid_files

    found = grid_files(
        grid,
        folder,
        labels=labels,
        picture=picture,
        n=n,
        seed=seed,
        jobs=jobs,
        **about,
    )
    show_result(found, as_json)

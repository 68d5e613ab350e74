"""The verb that simulates a grid and asks every method."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from typer import Option

from simbench.cli.common import (
    Address,
    AllowFailed,
    Backend,
    ControllerPlugin,
    EffectPlugin,
    Full,
    GridName,
    Jobs,
    Json,
    PlantPlugin,
    Plugin,
    Resume,
    ValvePlugin,
    app,
    end_by_failures,
    examples,
    number,
    pairs,
    reads,
    say,
    show,
    where_more_is,
)
from simbench.detectors.errors import ParameterError

if TYPE_CHECKING:
    from simbench.bench.execute.run_options import RunOptions


@app.command(
    epilog=examples(
        "run smoke -o runs/smoke",
        "run chapter -o runs/chapter -j 2 --method fast,oracle --resume",
        "run my_baseline -o run --plugin mine.py --method mine",
        "run runs/theirs -o runs/ours",
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

    # options of the loops and of the work
    if about and not (grid is not None and is_records(grid)):
        option, value = next(iter(about.items()))
        raise ParameterError(
            f"--{option.lower().replace('_', '-')} {value} says how records are read; GRID is"
            f" {grid}: a record, or a folder of records, is needed"
        )
    axes = {}
    for k, values in pairs(axis or [], "--axis", text=True).items():
        axes[k] = [number(v) for v in str(values).split(",")]
    options: RunOptions = {
        "n": n,
        "sets": pairs(sets or [], "--set"),
        "axes": axes,
        "fresh_seeds": fresh_seeds,
        "with_reference": with_reference,
        "plugins": plugin or [],
        "valve_plugins": valve_plugin or [],
        "effect_plugins": effect_plugin or [],
        "plant_plugins": plant_plugin or [],
        "controller_plugins": controller_plugin or [],
        "backend": cast("Any", backend),  # checked where the run begins
        "address": address,
        "resume": resume,
    }

    # add to a run, or run a grid, which may be made of records
    told = {}
    if add or answers:
        from simbench.bench.execute.add import add_to_run

        _refuse_beside_add(grid)
        folder, scores, told["added"] = add_to_run(
            str(grid), method or [], out, jobs, add=add, answers=answers or [], **options
        )
    elif grid is None:
        raise ParameterError("GRID is missing: name a grid; `simbench list grids` names them all")
    else:
        out = out or Path("runs") / Path(grid).stem
        plan: Any = grid
        if is_records(grid):
            from simbench.gap.benchmark.from_records import plan_of_records

            made = plan_of_records(grid, out, options, jobs=jobs, **about)
            say(made.as_text(), aside=True)
            plan = made.grid
            options["sets"] = None
        folder, scores = run_scored(plan, out, method or ["fast", ORACLE], jobs, **options)

    # scores, and what failed
    if scores is None or allow_failed:
        scores = score_run(folder, allow_failed=allow_failed)
    failed = read_failures(folder)
    if as_json:
        about = {"run": str(folder), "failed": failed.as_json()}
        show({**about, **told, **scores.as_json()}, as_json)
    else:
        lines = [scores.as_text(full=full, where=where_more_is(folder, full)), f"run: {folder}"]
        lines += told.values()
        show("\n".join(lines), as_json)
    end_by_failures(failed, allow_failed)


def _refuse_beside_add(grid: str | None) -> None:
    """Refuse --add and --answers without a finished run to add to."""
    from simbench.bench.store.benchmark import is_stored

    if grid is None or not is_stored(grid):
        raise ParameterError(
            f"--add and --answers add methods to a finished run; GRID is {grid}: the folder of a"
            " run is needed"
        )

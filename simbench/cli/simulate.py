"""The verbs `simulate` (one loop), `valve` (one valve model) and `predict` (theory)."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from simbench.cli.common import (
    ControllerPlugin,
    EffectPlugin,
    Json,
    PlantPlugin,
    ValvePlugin,
    app,
    examples,
    pairs,
    say,
    show,
)
from simbench.detectors.errors import ParameterError, naming


@app.command(
    epilog=examples(
        "simulate loop.toml -o rec.csv --seed 1",
        "simulate --from runs/ci --id ID -o rec.csv",
        "simulate ci -o records --n 200",
    )
)
def simulate(
    source: Annotated[
        str | None,
        Argument(
            metavar="LOOP.toml|GRID",
            help="Simulate the loop that this file (TOML) describes, or all loops of a grid: its"
            " name, its file, or the folder of a run.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            "-o",
            "--out",
            help="Write the record to this CSV file, or the records of a grid to this new folder.",
        ),
    ] = None,
    seed: Annotated[
        int | None, Option(min=0, help="Seed the random numbers with this integer [0].")
    ] = None,
    n: Annotated[
        int | None,
        Option(
            "--n",
            min=1,
            help="Draw this many scenarios at random from the grid, the same as `simbench run`"
            " draws [all].",
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
    kick: Annotated[
        float,
        Option(
            help=(
                "Move OP by this much (%) at the first sample, so that the loop starts away from "
                "rest."
            )
        ),
    ] = 0.0,
    from_run: Annotated[
        Path | None,
        Option(
            "--from",
            metavar="RUN",
            help="Simulate a scenario of the run in this folder again; choose it by --id.",
        ),
    ] = None,
    scenario: Annotated[
        str | None, Option("--id", help="Name the scenario of the run that is simulated.")
    ] = None,
    valve_plugin: ValvePlugin = None,
    effect_plugin: EffectPlugin = None,
    plant_plugin: PlantPlugin = None,
    controller_plugin: ControllerPlugin = None,
) -> None:
    """Simulate one closed loop and write its record: time, SP, OP, PV and MV.

    SP is the set point, OP the controller output (%), PV the process variable, and MV the valve
    position (%).

    Of a grid the records are written without MV and without labels, for programs in any language:
    records.parquet has the signals of all records, loops.csv what is known of each loop.
    `simbench run RUN --answers FILE.csv` scores what such a program answers.
    """
    from simbench.files import refuse_own_input
    from simbench.loop.part_files import added_parts
    from simbench.scenarios.grid import is_grid

    if (source is None) == (from_run is None):
        raise ParameterError(
            "simulate needs either a loop file or a grid, or --from RUN with --id ID"
        )
    if out is None:
        raise ParameterError("simulate needs -o REC.csv, the record to write")
    if not abs(kick) <= 100.0:
        raise ParameterError(f"--kick {kick:g}; an offset of OP within -100 to 100 % is needed")
    files = [
        given or [] for given in (valve_plugin, effect_plugin, plant_plugin, controller_plugin)
    ]
    with added_parts(*files):
        if source is not None and is_grid(source):
            _simulate_grid(source, out, n, pairs(sets or [], "--set"), seed, kick)
            return
        if n is not None or sets:
            raise ParameterError(f"--n and --set change a grid; {source or from_run} is none")
        loop = None if source is None else Path(source)
        refuse_own_input([out], [loop])
        _simulate_loop(loop, out, from_run, scenario, seed or 0, kick)


def _simulate_grid(
    grid: str, out: Path, n: int | None, sets: dict[str, Any], seed: int | None, kick: float
) -> None:
    from simbench.bench.execute.hand_out import write_records

    if seed is not None or kick:
        given = f"--kick {kick:g}" if seed is None else f"--seed {seed}"
        raise ParameterError(
            f"{given} is for one loop, and {grid} is a grid: a loop file is needed; --set seed=N"
            " changes the seed of a grid"
        )
    written = write_records(grid, out, n, sets)
    say(f"{out}: {written} records without labels: records.parquet, loops.csv")
    labels, run = "", grid
    if not Path(grid).is_dir():
        words = ["simbench", "run", grid, *(["--n", str(n)] if n else [])]
        words += [word for key, value in sets.items() for word in ("--set", f"{key}={value}")]
        labels, run = shlex.join([*words, "-o", "RUN"]) + ", then ", "RUN"
    say(f"to score answers to them: {labels}{shlex.join(['simbench', 'run', run])} --answers FILE")


def _simulate_loop(
    loop: Path | None,
    out: Path,
    from_run: Path | None,
    scenario: str | None,
    seed: int,
    kick: float,
) -> None:
    from simbench.files import write_record
    from simbench.loop.part_files import naming_parts
    from simbench.loop.simulate import simulate

    if from_run is not None:
        from simbench.bench.store.reading import read_scenario

        if scenario is None:
            raise ParameterError("simulate --from RUN needs --id, the scenario to repeat")
        repeated = read_scenario(from_run, scenario)
        with naming_parts():
            result = simulate(repeated.loop, repeated.seed, kick=kick)
    else:
        from simbench.scenarios.spec import load_loop

        with naming(loop), naming_parts():
            result = simulate(load_loop(loop), seed, kick=kick)
    write_record(result.record, out)
    if result.outer is not None:
        outer = out.with_name(f"{out.stem}_outer{out.suffix}")
        write_record(result.outer, outer)
        say(f"{outer}: the outer loop; its OP is the set point of the inner one, in {out}")
    r = result.record
    friction = "has friction" if result.sticky else "is without friction"
    say(f"{out}: {r.n} samples, Ts = {r.Ts:g} s, {r.duration:g} s; the valve {friction}")
    for note in result.notes:
        print(f"note: {note}")


@app.command(epilog=examples("valve --model choudhury --param S=5 --param J=2 op.csv -o mv.csv"))
def valve(
    source: Annotated[
        Path,
        Argument(
            metavar="IN.csv", help="Read the controller output from the column op of this table."
        ),
    ],
    model: Annotated[
        str, Option(help="Use this valve model; `simbench list valves` names them all.")
    ],
    out: Annotated[
        Path,
        Option("-o", "--out", help="Write the table with an added column mv, the valve position."),
    ],
    param: Annotated[
        list[str] | None,
        Option(
            "--param",
            metavar="NAME=VALUE",
            help="Set a parameter of the valve model; may be repeated.",
        ),
    ] = None,
    valve_plugin: ValvePlugin = None,
) -> None:
    """Drive one valve model with a recorded controller output; write the valve position."""
    from simbench.files import refuse_own_input
    from simbench.loop.part_files import added_parts, naming_parts
    from simbench.loop.response import valve_file

    refuse_own_input([out], [source])
    with added_parts(valve_plugin or []), naming_parts():
        valve_file(source, out, model, pairs(param or [], "--param"))


@app.command(epilog=examples("predict loop.toml", "predict loop.toml --json"))
def predict(
    loop: Annotated[
        Path, Argument(metavar="LOOP.toml", help="Predict the limit cycle of this loop file.")
    ],
    as_json: Json = False,
) -> None:
    """Predict from theory whether valve stiction makes a loop cycle.

    The output compares four answers: Table 11.3 of the book chapter that simbench implements, the
    same table with its conditions on the loop checked, the describing function (approximate
    period, amplitude of OP, stability), and the exact cycle, with the least offset of OP (%) that
    starts it from rest.
    """
    from simbench.scenarios.spec import load_loop
    from simbench.theory.predict import as_text
    from simbench.theory.predict import predict as theory

    with naming(loop):
        prediction = theory(load_loop(loop))
    show(prediction if as_json else as_text(prediction), as_json)

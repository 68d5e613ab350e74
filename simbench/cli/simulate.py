"""The verbs `simulate` (one loop), `valve` (one valve model) and `predict` (theory)."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    show_result,
    toml_value,
)
from simbench.detectors.errors import ParameterError, naming

if TYPE_CHECKING:
    from simbench.loop.run import Run
    from simbench.scenarios.spec import Loop


@app.command(
    epilog=examples(
        "simulate loop.toml -o rec.csv --seed 1",
        "simulate --from runs/ci --id ID -o rec.csv",
        "simulate loop.toml --set controller.Kc=2 --seeds 20",
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
    seeds: Annotated[
        int | None,
        Option(
            min=2,
            max=10_000,
            metavar="N",
            help="Simulate the loop with this many seeds, from --seed on, and print the standard"
            " deviations of PV and OP, the period and the travel of OP of one record, with 90 %"
            " intervals.",
        ),
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
            help="Change a setting of the loop, for example controller.Kc=2, or of the grid, for"
            " example seed=7; may be repeated.",
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
    as_json: Json = False,
) -> None:
    """Simulate one closed loop and write its record: time, SP, OP, PV and MV.

    SP is the set point, OP the controller output (%), PV the process variable, and MV the valve
    position (%).

    Of a grid the records are written without MV and without labels, for programs in any language:
    records.parquet has the signals of all records, loops.csv what is known of each loop.
    `simbench run RUN --answers FILE.csv` scores what such a program answers.

    With --seeds the command prints what one record of the loop looks like; with --set, what it
    would look like under other settings.
    """
    from simbench.files import refuse_own_input
    from simbench.loop.part_files import added_parts, naming_parts
    from simbench.loop.several_seeds import simulate_seeds
    from simbench.loop.simulate import simulate as simulate_loop
    from simbench.scenarios.grid import is_grid

    # One source, and one thing to write
    if (source is None) == (from_run is None):
        raise ParameterError(
            "simulate needs either a loop file or a grid, or --from RUN with --id ID"
        )
    if (out is None) == (seeds is None):
        raise ParameterError(
            "simulate needs either -o REC.csv, the record to write, or --seeds N; both or neither"
            " were given"
        )
    if not abs(kick) <= 100.0:
        raise ParameterError(f"--kick {kick:g}; an offset of OP within -100 to 100 % is needed")

    # With the parts of one's own: a grid, or a loop
    files = []
    for given in (valve_plugin, effect_plugin, plant_plugin, controller_plugin):
        files.append(given or [])
    with added_parts(*files):
        if source is not None and is_grid(source):
            if seeds is not None:
                raise ParameterError(f"--seeds {seeds}: {source} is a grid; a loop file is needed")
            _refuse_beside_grid(source, seed, kick)
            _simulate_grid(source, Path(str(out)), n, pairs(sets or [], "--set"), as_json)
            return
        if n is not None:
            raise ParameterError(f"--n {n}: {source or from_run} is no grid, which is needed")
        loop, first = _loop_to_simulate(source, from_run, scenario, seed, sets or [])
        with naming(source or from_run), naming_parts():
            if seeds is not None:
                show_result(simulate_seeds(loop, seeds, first, kick), as_json)
                return
            refuse_own_input([out], [source])
            result = simulate_loop(loop, first, kick=kick)

    # The record of one run
    _write_result(result, Path(str(out)), as_json)


def _loop_to_simulate(
    source: str | None,
    from_run: Path | None,
    scenario: str | None,
    seed: int | None,
    sets: list[str],
) -> tuple[Loop, int]:
    """Return the loop of a file or of a run, with changed settings, and the seed."""
    from simbench.bench.store.reading import read_scenario
    from simbench.scenarios.spec import load_loop

    if from_run is None:
        loop = load_loop(str(source))
        first = seed or 0
    elif scenario is None:
        raise ParameterError("simulate --from RUN needs --id, the scenario to repeat")
    else:
        repeated = read_scenario(from_run, scenario)
        loop = repeated.loop
        first = repeated.seed
    return loop.with_all(_settings_of(sets)), first


def _settings_of(sets: list[str]) -> dict[str, Any]:
    """Return the settings of a loop that --set changes."""
    return {k: toml_value(v) for k, v in pairs(sets, "--set", text=True).items()}


def _refuse_beside_grid(grid: str, seed: int | None, kick: float) -> None:
    """Refuse the options that are for one loop."""
    if seed is not None or kick:
        if seed is None:
            given = f"--kick {kick:g}"
        else:
            given = f"--seed {seed}"
        raise ParameterError(
            f"{given} is for one loop, and {grid} is a grid: a loop file is needed; --set seed=N"
            " changes the seed of a grid"
        )


def _simulate_grid(
    grid: str, out: Path, n: int | None, sets: dict[str, Any], as_json: bool
) -> None:
    """Write the records of a grid, and print how many they are and how answers are scored."""
    from simbench.bench.execute.hand_out import write_records
    from simbench.usage import setting_words

    written = write_records(grid, out, n, sets)
    if as_json:
        show({"records": str(out), "n": written}, as_json)
        return
    say(f"{out}: {written} records without labels: records.parquet, loops.csv")
    labels = ""
    run = grid
    if not Path(grid).is_dir():
        words = ["simbench", "run", grid] + (["--n", str(n)] if n else [])
        words += setting_words(sets)
        labels = shlex.join(words + ["-o", "RUN"]) + ", then "
        run = "RUN"
    say(f"to score answers to them: {labels}{shlex.join(['simbench', 'run', run])} --answers FILE")


def _write_result(result: Run, out: Path, as_json: bool) -> None:
    """Write the record of a run, and print what it is."""
    from simbench.files import write_record

    r = result.record
    write_record(r, out)
    if result.outer is not None:
        outer = out.with_name(f"{out.stem}_outer{out.suffix}")
        write_record(result.outer, outer)
        text = f"{outer}: the outer loop; its OP is the set point of the inner one, in {out}"
        say(text, as_json)
    if as_json:
        about = {"n": r.n, "Ts": r.Ts, "sticky": result.sticky, "notes": list(result.notes)}
        show({"record": str(out), **about}, as_json)
        return
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
    from simbench.cli.valve_table import valve_file
    from simbench.files import refuse_own_input
    from simbench.loop.part_files import added_parts, naming_parts

    refuse_own_input([out], [source])
    with added_parts(valve_plugin or []), naming_parts():
        valve_file(source, out, model, pairs(param or [], "--param"))


@app.command(epilog=examples("predict loop.toml", "predict loop.toml --set controller.Kc=2"))
def predict(
    loop: Annotated[
        Path, Argument(metavar="LOOP.toml", help="Predict the limit cycle of this loop file.")
    ],
    sets: Annotated[
        list[str] | None,
        Option(
            "--set",
            metavar="K=V",
            help="Change a setting of the loop, for example controller.Kc=2; may be repeated.",
        ),
    ] = None,
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
        prediction = theory(load_loop(loop).with_all(_settings_of(sets or [])))
    show(prediction if as_json else as_text(prediction), as_json)

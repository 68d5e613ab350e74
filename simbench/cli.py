"""The command line: one verb, one function call."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from detectors.errors import ParameterError, UserError, nearest
from scenarios.errors import SpecError

# typer has carried its own copy of click since 0.2x; its public error leads to the classes of whichever it uses
CommandError: Any = typer.BadParameter.__mro__[2]

Json = Annotated[bool, typer.Option("--json", help="JSON, and nothing else, on stdout.")]
Jobs = Annotated[int, typer.Option("-j", "--jobs", help="Worker processes; -1 = all cores.")]
Plugin = Annotated[list[Path] | None, typer.Option("--plugin", help="File of a further detector; repeatable.")]
Span = Annotated[tuple[float, float] | None, typer.Option(metavar="LO HI", help="Values that mean 0 and 100 %.")]

_bare = {"add_completion": False, "no_args_is_help": True, "rich_markup_mode": None, "pretty_exceptions_enable": False}
app = typer.Typer(help="A closed-loop testbench for valve-stiction detectors.", **_bare)
confirm_app = typer.Typer(help="Is it the valve? The chapter's confirmation tests on a simulated loop.", **_bare)
gap_app = typer.Typer(help="Why is the simulation unlike the plant?", **_bare)
withheld_app = typer.Typer(help="The blind check of the gap diagnosis.", **_bare)
app.add_typer(confirm_app, name="confirm")
app.add_typer(gap_app, name="gap")
gap_app.add_typer(withheld_app, name="withheld")


@app.command()
def simulate(
    loop: Annotated[Path | None, typer.Argument(metavar="LOOP.toml", help="Loop file.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Record to write (CSV).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Root of all random numbers.")] = 0,
    kick: Annotated[float, typer.Option(help="Offset of OP at sample 0 (%).")] = 0.0,
    from_run: Annotated[Path | None, typer.Option("--from", metavar="RUN", help="Folder of a run.")] = None,
    scenario: Annotated[str | None, typer.Option("--id", help="Scenario of that run.")] = None,
) -> None:
    """Run one closed loop and write its record."""
    from simbench.files import write_record
    from simbench.loop.simulate import simulate as run

    if (loop is None) == (from_run is None):
        raise ParameterError("simulate needs either a loop file, or --from RUN with --id ID")
    if out is None:
        raise ParameterError("simulate needs -o REC.csv, the record to write")
    if from_run is not None:
        from simbench.bench.store import read_scenario

        if scenario is None:
            raise ParameterError("simulate --from RUN needs --id, the scenario to repeat")
        found = read_scenario(from_run, scenario)
        result = run(found.loop, found.seed, kick=kick)
    else:
        from scenarios.spec import load_loop

        result = run(load_loop(loop), seed, kick=kick)
    write_record(result.record, out)


@app.command()
def valve(
    source: Annotated[Path, typer.Argument(metavar="IN.csv", help="Table with a column op.")],
    model: Annotated[str, typer.Option(help="Valve model.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Table to write, with a column mv.")],
    param: Annotated[list[str] | None, typer.Option("--param", metavar="NAME=VALUE", help="Repeatable.")] = None,
) -> None:
    """Send a column `op` through one valve model."""
    from simbench.loop.response import valve_file

    valve_file(source, out, model, _pairs(param or [], "--param"))


@app.command()
def predict(
    loop: Annotated[Path, typer.Argument(metavar="LOOP.toml")],
    as_json: Json = False,
) -> None:
    """Say what theory expects of a loop: table, describing function, exact cycle."""
    from scenarios.spec import load_loop
    from simbench.theory.predict import as_text
    from simbench.theory.predict import predict as theory

    found = theory(load_loop(loop))
    _print(found if as_json else as_text(found), as_json)


@app.command()
def detect(
    path: Annotated[Path, typer.Argument(metavar="REC.csv|DIR", help="Record, or folder of records.")],
    method: Annotated[list[str] | None, typer.Option(help="Method ids, all, fast or full; repeatable.")] = None,
    process: Annotated[str | None, typer.Option(help="self-regulating or integrating.")] = None,
    kind: Annotated[str | None, typer.Option(help="flow, level, pressure, temperature or analyser.")] = None,
    op_span: Span = None,
    pv_span: Span = None,
    labels: Annotated[Path | None, typer.Option(help="Table with id and label: judge and score its records.")] = None,
    raw: Annotated[bool, typer.Option("--raw", help="Without the oscillation front end.")] = False,
    plugin: Plugin = None,
    as_json: Json = False,
) -> None:
    """Judge a record, or a folder of records, by one or all detectors."""
    from detectors.report import judge_files, table

    report = judge_files(
        path, method or ["all"], process=process, kind=kind, op_span=op_span, pv_span=pv_span, labels=labels, raw=raw,
        plugins=plugin or [],
    )  # fmt: skip
    for name, sentence in report.refused.items():
        print(f"left out {name}: {sentence}", file=sys.stderr)
    if as_json and report.scores:
        print("\n".join(["score by unit:", *table(report.scores)]), file=sys.stderr)
    _print(report.as_json() if as_json else report.as_text(), as_json)


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
    command = typer.main.get_command(app)
    try:
        code = command.main(args=arguments, prog_name="simbench", standalone_mode=False)
        return int(code or 0)
    except CommandError as error:
        return _complain(_usage(error))
    except (UserError, SpecError) as error:
        return _complain(str(error))
    except MemoryError:
        return _complain("not enough memory for this; ask for fewer samples or scenarios")
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:
        return _complain(f"{error.filename or 'output'}: {(error.strerror or str(error)).lower()}")
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        return 130


def entry() -> None:
    """Console script."""
    sys.exit(main())


def _complain(sentence: str) -> int:
    print(f"error: {' '.join(sentence.split())}", file=sys.stderr)
    return 2


def _usage(error: Any) -> str:
    message = error.format_message().strip()
    context = getattr(error, "ctx", None)
    if message.startswith("Usage:"):
        return "a verb is missing: " + ", ".join(_verbs(context))
    if "such command" in message and "mean" not in message:
        message += f" Known: {', '.join(_verbs(context))}"
    return message[0].lower() + message[1:]


def _verbs(context: Any) -> list[str]:
    return [] if context is None else context.command.list_commands(context)


def _pairs(words: list[str], option: str) -> dict[str, Any]:
    pairs = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ParameterError(f"{option} {word!r}: NAME=VALUE is needed")
        pairs[name] = _number(value)
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

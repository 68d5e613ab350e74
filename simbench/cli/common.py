"""What the verbs of the command line share: the application, common options, and how an answer is
printed.
"""

from __future__ import annotations

import functools
import inspect
import json
import os
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from simbench.cli.help import GroupedCommand
from simbench.detectors.errors import ParameterError, masked, printable

if TYPE_CHECKING:
    from simbench.bench.execute.failures import Failures
    from simbench.detectors.record import LoopRecord

_COLUMNS = 100  # of a terminal, beyond which a sentence goes on in the next line
_BARE: dict[str, Any] = {
    "add_completion": False,
    "no_args_is_help": True,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}


class _Verbs(typer.Typer):
    """An application whose verbs print their options in groups."""

    def command(self, *args: Any, **settings: Any) -> Any:
        """Add a verb, as `typer.Typer.command`."""
        return super().command(*args, cls=GroupedCommand, **settings)


app = _Verbs(
    help="Simulate control loops with sticking and healthy valves, score stiction detectors on"
    " them,"
    " and diagnose records from a plant.",
    context_settings={"max_content_width": _COLUMNS},
    **{**_BARE, "add_completion": True},
)
confirm_app = _Verbs(
    help="Confirm that the valve sticks by a test on the loop, simulated or recorded.",
    **_BARE,
)
gap_app = _Verbs(help="Explain why a simulation differs from the plant.", **_BARE)
app.add_typer(confirm_app, name="confirm")
app.add_typer(gap_app, name="gap")


def examples(*lines: str) -> str:
    """Return what ends the help of a verb: its examples, unwrapped."""
    return "\b\nExamples:\n" + "\n".join(f"  simbench {line}" for line in lines)


def _check_workers(jobs: int) -> int:
    most = max(64, 4 * (os.cpu_count() or 1))
    if jobs == 0 or jobs < -1 or jobs > most:
        raise ParameterError(
            f"-j {jobs}; worker processes are 1 to {most}, or -1 for one on every core"
        )
    return jobs


Json = Annotated[bool, Option("--json", help="Print JSON, and nothing else, on stdout.")]
Backend = Annotated[
    str,
    Option(metavar="loky|dask|ray", help="Choose the library that starts the worker processes."),
]
Address = Annotated[
    str | None,
    Option(metavar="URL", help="Connect to the running dask or ray scheduler at this address."),
]
Resume = Annotated[bool, Option("--resume", help="Continue a call that was interrupted.")]
Full = Annotated[
    bool, Option("--full", help="Print every table, with the results by process type and by label.")
]
Jobs = Annotated[
    int,
    Option(
        "-j",
        "--jobs",
        callback=_check_workers,
        help="Use this many worker processes; -1 uses all cores.",
    ),
]


def _file_option(what: str) -> Any:
    return Option(
        metavar="FILE.py", help=f"Load an additional {what} from this Python file; may be repeated."
    )


Files = list[Path] | None
Plugin = Annotated[Files, _file_option("detector")]
ValvePlugin = Annotated[Files, _file_option("valve model")]
EffectPlugin = Annotated[Files, _file_option("effect")]
PlantPlugin = Annotated[Files, _file_option("plant")]
ControllerPlugin = Annotated[Files, _file_option("controller")]


def _span_option(signal: str) -> Any:
    return Annotated[
        tuple[float, float] | None,
        Option(
            metavar="LO HI", help=f"State the recorded values of {signal} that mean 0 and 100 %."
        ),
    ]


_READING: dict[str, Any] = {
    "process": Annotated[
        str | None,
        Option(
            metavar="TYPE",
            help="State the type of the process: self-regulating or integrating. If it is not"
            " given,"
            " it is estimated from the record where possible.",
        ),
    ],
    "kind": Annotated[
        str | None,
        Option(
            metavar="KIND",
            help="State what the loop controls: flow, level, pressure, temperature or analyser."
            " Some methods apply only to some kinds.",
        ),
    ],
    "op_span": _span_option("OP"),
    "pv_span": _span_option("PV"),
    "columns": Annotated[
        list[str] | None,
        Option(
            metavar="op=NAME,pv=NAME",
            help="Assign a column to a signal, as in pv=FIC101.PV; may be repeated.",
        ),
    ],
    "Ts": Annotated[
        float | None,
        Option(
            "--ts",
            metavar="S",
            help="State the sampling period (s) of a record without a time column.",
        ),
    ],
    "resample": Annotated[
        str | None,
        Option(
            metavar="held|linear",
            help="Resample what was recorded at uneven times to an even grid (of --ts, or of their"
            " median step): each value held until the next, or straight lines between them.",
        ),
    ],
    "tag": Annotated[
        str | None,
        Option(
            metavar="TAG",
            help=(
                "Choose one loop by its tag from a file that holds several, for example FIC101 or "
                "chemicals.loop1."
            ),
        ),
    ],
    "loops": Annotated[
        Path | None,
        Option(
            metavar="TABLE.toml",
            help=(
                "Read what is known of each loop from this TOML file, with one [[loop]] table per "
                "tag."
            ),
        ),
    ],
}
Page = Annotated[
    Path | None, Option(metavar="FILE.html", help="Write an HTML page with pictures to this file.")
]
Report = Annotated[
    Path | None,
    Option(metavar="FILE.html", help="Write an HTML report with pictures to this file."),
]
Seed = Annotated[int, Option(min=0, help="Seed the random numbers with this integer.")]


def reads(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb the options that say how a record is read and what is known of it; it takes them
    as `about`.
    """
    signature = inspect.signature(verb, eval_str=True)
    named = inspect.Parameter.KEYWORD_ONLY
    kept = [p.replace(kind=named) for name, p in signature.parameters.items() if name != "about"]
    added = []
    for name, kind in _READING.items():
        added.append(inspect.Parameter(name, named, default=None, annotation=kind))

    @functools.wraps(verb)
    def asked(**values: Any) -> None:
        from simbench.usage import column_pairs

        about = {}
        for name in _READING:
            about[name] = values.pop(name, None)
        about["columns"] = column_pairs(about["columns"])
        verb(**values, about={name: value for name, value in about.items() if value is not None})

    last = [p for p in kept if p.name == "as_json"]
    asked.__signature__ = signature.replace(
        parameters=[p for p in kept if p not in last] + added + last
    )  # pyright: ignore[reportAttributeAccessIssue]
    asked.__annotations__ = {p.name: p.annotation for p in tuple(kept) + tuple(added)}
    return asked


def say_assumed(records: Iterable[LoopRecord], as_json: bool) -> None:
    """Print what reading the records assumed, once where it is the same: after JSON, or of several
    records, on stderr.
    """
    # which records have each note
    read = list(records)
    tags: dict[str, list[str]] = {}
    for record in read:
        for note in record.notes:
            tags.setdefault(note, []).append(str(record.tag))

    # of several records, whose it is
    for note, of in tags.items():
        if len(of) == len(read):
            several = f"all {len(read)} records"
        else:
            several = ", ".join(of)
        if len(read) > 1:
            whose = f"{several}: "
        else:
            whose = ""
        line = wrap_lines(f"note: {whose}{note}")
        print(line, file=sys.stderr if as_json or whose else sys.stdout)


def method_completion(incomplete: str) -> list[str]:
    """Return the method ids that begin so."""
    from simbench.detectors.plugins.registry import methods

    names = []
    for name in ("all", "fast", "full", *methods.every_name()):
        if name.startswith(incomplete):
            names.append(name)
    return names


MethodIds = Annotated[
    list[str] | None,
    Option(
        metavar="ID",
        help="Apply these methods: ids, or the groups all, fast or full; may be repeated [all].",
        autocompletion=method_completion,
    ),
]


def grid_completion(incomplete: str) -> list[str]:
    """Return the grids that begin so."""
    from simbench.scenarios.packaged import grid_names

    return [name for name in grid_names() if name.startswith(incomplete)]


_GRID = Argument(
    metavar="GRID",
    help="Name a grid (a set of scenarios; `simbench list grids` names them), or give a TOML"
    " file, or the folder of a run or baseline; for `simbench run` also a record, or a folder of"
    " records.",
    autocompletion=grid_completion,
)
GridName = Annotated[str | None, _GRID]


def refuse_picture(path: Path | None, *read: Path | None) -> None:
    """Refuse, before any work, a picture that would stand in place of what is read, or is of no
    known kind.
    """
    from simbench.files import picture_kind, refuse_own_input

    refuse_own_input([path], read)
    if path is not None:
        picture_kind(path)


def pairs(words: list[str], option: str, text: bool = False) -> dict[str, Any]:
    """Return NAME=VALUE words as a table; an axis may be written as in the book."""
    # Each word is NAME=VALUE, and no name comes twice
    pairs = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = axis_name(name)
        if not equals or not name:
            raise ParameterError(f"{option} {word!r}: NAME=VALUE is needed")
        if name in pairs:
            raise ParameterError(
                f"{option} {word!r}: {name} = {pairs[name]} was given already; once is allowed"
            )
        if text:
            pairs[name] = value
        else:
            pairs[name] = number(value)
    return pairs


def axis_name(text: str) -> str:
    """Return the name of an axis that may be written as a fraction.

    >>> axis_name("Td/T"), axis_name("S/2J"), axis_name("valve.S")
    ('Td_over_T', 'S_over_2J', 'valve.S')
    """
    return text.replace("/", "_over_")


def number(text: str) -> Any:
    """Return a word as a number where it is one; a whole one keeps digits that a float has not.

    >>> number("7"), number("4611686018427387905"), number("slow")
    (7.0, 4611686018427387905, 'slow')
    """
    try:
        if "_" in text:
            value = text
        else:
            value = float(text)
    except ValueError:
        return text
    whole = text.isdecimal() and int(text)
    return whole if whole and whole != value else value


def toml_value(text: str) -> Any:
    """Return what a text is in TOML; a word that is nothing in TOML stands for itself.

    >>> toml_value("2"), toml_value("[[10, 55]]"), toml_value("direct")
    (2, [[10, 55]], 'direct')
    """
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def show_result(result: Any, as_json: bool) -> None:
    """Print a result as text, or as JSON where asked."""
    show(result.as_json() if as_json else result.as_text(), as_json)


def show(content: Any, as_json: bool) -> None:
    """Print an answer, as JSON where asked."""
    say(json.dumps(content, indent=1, allow_nan=False) if as_json else wrap_lines(str(content)))
    sys.stdout.flush()


def say(text: object, aside: bool = False) -> None:
    """Print a text (aside: on stderr) with secrets masked and what is not printable escaped."""
    print(printable(masked(text), "\n"), file=sys.stderr if aside else sys.stdout)


def wrap_lines(text: str) -> str:
    """Return a text whose lines are broken at blanks to `_COLUMNS`; what follows is indented.

    A row of a table, known by two blanks in a row, stays whole.

    >>> wrap_lines("word " * 24).splitlines()[1]
    '  word word word word'
    """
    # Short lines and tables stay; others are wrapped below their own margin
    lines = []
    for line in text.splitlines():
        if len(line) <= _COLUMNS or "  " in line.strip():
            lines.append(line)
            continue
        margin = line[: len(line) - len(line.lstrip())] + "  "
        lines += textwrap.wrap(
            line,
            _COLUMNS,
            subsequent_indent=margin,
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(lines)


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


def where_more_is(folder: Path, full: bool) -> str:
    """Return the line that says where the columns are explained and what shows more."""
    page = f"simbench score {folder} --report FILE.html"
    return (
        f"Columns: simbench score --help; {'' if full else 'every table: --full; '}a page: {page}"
    )


def end_by_failures(failed: Failures, allowed: float) -> None:
    """Report what failed, and end with 1 where it is more than allowed."""
    if str(failed):
        print(f"failed: {failed}", file=sys.stderr)
    if failed.above(allowed):
        raise typer.Exit(1)

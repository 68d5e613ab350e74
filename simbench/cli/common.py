"""What the verbs share: the applications they belong to, options, and how an answer is printed."""

from __future__ import annotations

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from detectors.errors import ParameterError, masked

if TYPE_CHECKING:
    from detectors.record import LoopRecord

_BARE: dict[str, Any] = {
    "add_completion": False,
    "no_args_is_help": True,
    "rich_markup_mode": None,
    "pretty_exceptions_enable": False,
}
app = typer.Typer(
    help="A closed-loop testbench for valve-stiction detectors.",
    **{**_BARE, "add_completion": True},
)
confirm_app = typer.Typer(
    help="Is it the valve? The chapter's confirmation tests, on a simulated loop or on records.",
    **_BARE,
)
gap_app = typer.Typer(help="Why is the simulation unlike the plant?", **_BARE)
withheld_app = typer.Typer(help="The blind check of the gap diagnosis.", **_BARE)
exam_app = typer.Typer(
    help="A benchmark whose records hold no truth: for methods of others, in any language.", **_BARE
)
app.add_typer(exam_app, name="exam")
app.add_typer(confirm_app, name="confirm")
app.add_typer(gap_app, name="gap")
gap_app.add_typer(withheld_app, name="withheld")


def examples(*lines: str) -> str:
    """Return what ends the help of a verb: its examples, unwrapped."""
    return "\b\nExamples:\n" + "\n".join(f"  simbench {line}" for line in lines)


def _workers(jobs: int) -> int:
    most = max(64, 4 * (os.cpu_count() or 1))
    if jobs == 0 or jobs < -1 or jobs > most:
        raise ParameterError(
            f"-j {jobs}; worker processes are 1 to {most}, or -1 for one on every core"
        )
    return jobs


Json = Annotated[bool, Option("--json", help="JSON, and nothing else, on stdout.")]
Backend = Annotated[str, Option(metavar="loky|dask|ray", help="What simulates the scenarios.")]
Address = Annotated[str | None, Option(metavar="URL", help="Address of a running scheduler.")]
Resume = Annotated[bool, Option("--resume", help="Continue where an earlier call stopped.")]
Full = Annotated[bool, Option("--full", help="Print every table.")]
Jobs = Annotated[
    int, Option("-j", "--jobs", callback=_workers, help="Worker processes; -1 = all cores.")
]


def _file(what: str) -> Any:
    return Option(metavar="FILE.py", help=f"File of a further {what}; repeatable.")


Files = list[Path] | None
Plugin = Annotated[Files, _file("detector")]
ValvePlugin = Annotated[Files, _file("valve model")]
EffectPlugin = Annotated[Files, _file("effect")]
PlantPlugin = Annotated[Files, _file("plant")]
ControllerPlugin = Annotated[Files, _file("controller")]
Limit = Annotated[
    float,
    Option(
        "--time-limit", metavar="S", help="Seconds a plug-in may take for a record or scenario."
    ),
]
Thresholds = Annotated[
    Path | None,
    Option(
        metavar="FILE.json",
        help="Other thresholds than the published ones, as calibrate writes them.",
    ),
]
Span = Annotated[
    tuple[float, float] | None, Option(metavar="LO HI", help="Values that mean 0 and 100 %.")
]
_READING: dict[str, Any] = {
    "process": Annotated[str | None, Option(help="self-regulating or integrating.")],
    "kind": Annotated[str | None, Option(help="flow, level, pressure, temperature or analyser.")],
    "op_span": Span,
    "pv_span": Span,
    "columns": Annotated[
        list[str] | None,
        Option(metavar="op=NAME,pv=NAME", help="Which column is what; repeatable."),
    ],
    "Ts": Annotated[
        float | None,
        Option("--ts", metavar="S", help="Sampling period (s), where no column states it."),
    ],
    "tag": Annotated[
        str | None,
        Option(metavar="TAG", help="Loop of a file with several: FIC101, chemicals.loop1."),
    ],
    "longest_segment": Annotated[
        bool | None,
        Option(
            "--longest-segment",
            help="Of a record with long gaps, take the longest part without one.",
        ),
    ],
    "loops": Annotated[
        Path | None,
        Option(metavar="TABLE.toml", help="What is known of loops, a [[loop]] table per tag."),
    ],
}
Page = Annotated[Path | None, Option(metavar="FILE.html", help="Page to write.")]
Report = Annotated[Path | None, Option(metavar="FILE.html", help="Report with pictures to write.")]
Seed = Annotated[int, Option(min=0)]
Power = Annotated[
    bool,
    Option("--power", help="Also say what this record could have shown, from twins of its loop."),
]
FrontEnd = Annotated[
    str, Option(metavar="acf|hagglund", help="Method that decides whether a loop oscillates.")
]
World = Annotated[
    str, Option(metavar="NAME", help="Plant simulator that draws the records: a name, or a module.")
]


def reads(also_loop: bool = False) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a verb the options that say how a record is read and what is known of it; it takes them
    as `about`.
    """
    options = dict(_READING)
    if also_loop:  # as detect called its tag before every verb had one
        tag_option = Option(
            "--tag",
            "--loop",
            metavar="TAG",
            help="Loop of a file with several: FIC101, chemicals.loop1.",
        )
        options["tag"] = Annotated[str | None, tag_option]

    def given(verb: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(verb, eval_str=True)
        named = inspect.Parameter.KEYWORD_ONLY
        kept = [
            p.replace(kind=named) for name, p in signature.parameters.items() if name != "about"
        ]
        added = [
            inspect.Parameter(name, named, default=None, annotation=kind)
            for name, kind in options.items()
        ]

        @functools.wraps(verb)
        def asked(**values: Any) -> None:
            from detectors.records.roles import column_pairs

            about = {name: values.pop(name, None) for name in options}
            about["columns"] = column_pairs(about["columns"])
            verb(
                **values, about={name: value for name, value in about.items() if value is not None}
            )

        last = [p for p in kept if p.name == "as_json"]
        asked.__signature__ = signature.replace(
            parameters=[*(p for p in kept if p not in last), *added, *last]
        )  # pyright: ignore[reportAttributeAccessIssue]
        asked.__annotations__ = {p.name: p.annotation for p in (*kept, *added)}
        return asked

    return given


def say_assumed(records: Iterable[LoopRecord], as_json: bool) -> None:
    """Print what reading the records assumed: after JSON, or of several records, on
    stderr.
    """
    read = list(records)
    for record in read:
        whose = f"{record.tag}: " if len(read) > 1 else ""
        for note in record.notes:
            print(f"note: {whose}{note}", file=sys.stderr if as_json or whose else sys.stdout)


def method_completion(incomplete: str) -> list[str]:
    """Return the method ids that begin so."""
    from detectors.plugins.registry import methods

    return [
        name
        for name in ("all", "fast", "full", *methods.names(), *methods.lent)
        if name.startswith(incomplete)
    ]


def grid_completion(incomplete: str) -> list[str]:
    """Return the grids that begin so."""
    from scenarios.grid import grid_names

    return [name for name in grid_names() if name.startswith(incomplete)]


GridName = Annotated[
    str, Argument(help="Name of a grid, or a TOML file.", autocompletion=grid_completion)
]


def refuse_picture(path: Path | None, *read: Path | None) -> None:
    """Refuse, before any work, a picture that would stand in place of what is read, or is of no
    known kind.
    """
    from simbench.files import picture_kind, refuse_own_input

    refuse_own_input([path], read)
    if path is not None:
        picture_kind(path)


def threshold_file(path: Path | None) -> dict[str, dict[str, float]]:
    """Return the thresholds of a file, checked; none without one."""
    if path is None:
        return {}
    if path.exists() and not path.is_file() and not path.is_dir():  # a pipe would be waited for
        raise ParameterError(f"thresholds {path} are no file; a JSON file is needed")
    try:
        thresholds = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(
            f"thresholds {path} cannot be read: {(error.strerror or str(error)).lower()}"
        ) from None
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ParameterError(
            f"thresholds {path} are no JSON ({reason}); a table of method ids is needed"
        ) from None
    if not isinstance(thresholds, dict) or not all(
        isinstance(v, dict) for v in thresholds.values()
    ):
        raise ParameterError(
            f"thresholds {path}: a table of method ids to tables of numbers is needed"
        )
    for method, values in thresholds.items():
        for name, value in values.items():
            if (
                isinstance(value, bool)
                or not isinstance(value, (int, float))
                or not abs(value) <= 1e60
            ):
                raise ParameterError(
                    f"thresholds {path}: {method}.{name} = {str(value)[:60]!r}; a finite number is"
                    " needed"
                )
    return thresholds


def pairs(words: list[str], option: str, text: bool = False) -> dict[str, Any]:
    """Return NAME=VALUE words as a table."""
    pairs = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ParameterError(f"{option} {word!r}: NAME=VALUE is needed")
        if name in pairs:
            raise ParameterError(
                f"{option} {word!r}: {name} = {pairs[name]} was given already; once is allowed"
            )
        pairs[name] = value if text else number(value)
    return pairs


def number(text: str) -> Any:
    """Return a word as a number where it is one."""
    try:
        return text if "_" in text else float(text)
    except ValueError:
        return text


def show_result(result: Any, as_json: bool) -> None:
    """Print a result as text, or as JSON where asked."""
    show(result.as_json() if as_json else result.as_text(), as_json)


def show(content: Any, as_json: bool) -> None:
    """Print an answer, as JSON where asked."""
    print(masked(json.dumps(content, indent=1, allow_nan=False) if as_json else content))
    sys.stdout.flush()

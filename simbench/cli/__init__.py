"""The command line `simbench`: each verb reads its options and calls one function of another
subpackage.
"""

from __future__ import annotations

import gc
import logging
import os
import sys
from itertools import pairwise
from typing import Annotated, Any

# before numpy is imported: on records of this size BLAS threads only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import typer
from typer import Exit, Option

from simbench.detectors.errors import ParameterError

# without a home folder matplotlib warns that its cache is temporary, which needs no
# action
logging.getLogger("matplotlib").setLevel(logging.ERROR)

# New objects before garbage is looked for. With Python's 700 `detect` and `gap diagnose` take
# 1.05 to 1.1 times as long at their first use, for imports and numba make millions of objects that
# stay; it costs 30 MB.
_NEW_OBJECTS = 20_000

# each registers its verbs, in the order of the help
from simbench.cli import simulate, detect, run, bench, confirm, gap, catalogue  # isort: skip  # noqa: F401
from simbench.cli.common import app
from simbench.usage import exit_code

# typer has carried a copy of click since 0.2x; its public error leads to the classes of
# whichever it uses
CommandError: Any = typer.BadParameter.__mro__[2]


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(version("stiction-simbench"))
        raise Exit


@app.callback()
def about(
    version: Annotated[
        bool, Option("--version", is_eager=True, callback=_print_version, help="Print the version.")
    ] = False,
) -> None:
    """Simulate control loops with sticking and healthy valves, score detectors, and diagnose
    records.
    """


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return exit_code(
        lambda: _run_command(arguments),
        ["simbench"] + (sys.argv[1:] if arguments is None else arguments),
    )


def entry() -> None:
    """Run the command line as a console script."""
    gc.set_threshold(_NEW_OBJECTS)
    # an unknown one ends matplotlib's import, and nothing is shown on a screen here
    os.environ.pop("MPLBACKEND", None)
    sys.exit(main())


def _run_command(arguments: list[str] | None) -> int | None:
    # The words of the command line, none of them empty
    command = typer.main.get_command(app)
    if arguments is None:
        words = sys.argv[1:]
    else:
        words = arguments
    if "" in words:  # as a path it would be the folder in which the command runs
        raise ParameterError(
            f"argument {words.index('') + 1} is empty, as of a shell variable that is not set; a"
            " path or a value is needed"
        )

    # Errors of the parser are errors of the command
    try:
        return command.main(args=words or ["--help"], prog_name="simbench", standalone_mode=False)
    except CommandError as error:
        raise ParameterError(_usage_sentence(error, words)) from None
    except typer.Abort as error:
        raise KeyboardInterrupt(str(error)) from None


def _usage_sentence(error: Any, arguments: list[str]) -> str:
    message = error.format_message().strip()
    if message.startswith("Invalid value for "):
        # the sentence names the option and what is allowed, not what was given
        option, _, allowed = message.partition(": ")
        given = []
        for k, v in pairwise(arguments):
            if k.lstrip("-") and f"'{k}'" in option:
                given.append(v)
        if given:
            message = f"{option}: {given[0][:80]!r}: {allowed}"
    context = getattr(error, "ctx", None)
    if "unexpected extra argument" in message and context is not None:
        message += f"; allowed: {' '.join(context.command.collect_usage_pieces(context))}"
    if message.startswith("Usage:"):
        return "a verb is missing: " + ", ".join(_list_verbs(context))
    if "such command" in message and "mean" not in message:
        message += f" Known: {', '.join(_list_verbs(context))}"
    return message[0].lower() + message[1:]


def _list_verbs(context: Any) -> list[str]:
    if context is None:
        return []
    return context.command.list_commands(context)

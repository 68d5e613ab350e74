"""The command line: what every command says when asked for --help."""

from __future__ import annotations

from text import heading
from typer.main import get_command
from typer.testing import CliRunner

from simbench.cli import app

WIDTH = {"COLUMNS": "100", "TERMINAL_WIDTH": "100", "NO_COLOR": "1"}


def commands_page() -> str:
    """Return the page."""
    lines = [*heading("Command line"), "Every verb and its options, as ``--help`` prints them.", ""]
    for words in verbs():
        said = CliRunner().invoke(app, [*words, "--help"], prog_name="simbench", env=WIDTH)
        assert said.exit_code == 0, said.output
        lines += [*heading(" ".join(["simbench", *words]), "-"), ".. code-block:: text", ""]
        lines += [f"   {line}".rstrip() for line in said.output.strip().splitlines()] + [""]
    return "\n".join(lines)


def verbs() -> list[list[str]]:
    """Return the words of every command that does something."""

    def below(command, words):
        inside = getattr(command, "commands", None)
        if inside is None:
            return [words]
        return [
            found
            for name, one in inside.items()
            if not one.hidden
            for found in below(one, [*words, name])
        ]

    return below(get_command(app), [])

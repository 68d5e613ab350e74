"""The command line: the --help of every command."""

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
        help_text = CliRunner().invoke(app, [*words, "--help"], prog_name="simbench", env=WIDTH)
        assert help_text.exit_code == 0, help_text.output
        lines += [*heading(" ".join(["simbench", *words]), "-"), ".. code-block:: text", ""]
        lines += [f"   {line}".rstrip() for line in help_text.output.strip().splitlines()] + [""]
    return "\n".join(lines)


def verbs() -> list[list[str]]:
    """Return the words of every command that does something."""

    def below(command, words):
        inside = getattr(command, "commands", None)
        if inside is None:
            return [words]
        return [
            commands
            for name, one in inside.items()
            if not one.hidden
            for commands in below(one, [*words, name])
        ]

    return below(get_command(app), [])

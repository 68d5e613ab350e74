"""Run a verb, and print its help with the options in groups."""

from __future__ import annotations

import sys
from typing import Any

from typer import Exit
from typer.core import TyperCommand

from simbench.detectors.errors import masked
from simbench.detectors.faults import describe_judging

COMMON = "Options"
# what every verb that reads a record takes is explained once
_READING = "Reading the record"
_EXPLAINS = "detect"
# which group an option's help stands in; what is in none is common
GROUPS = {
    "Reading the record": (
        "process",
        "kind",
        "op_span",
        "pv_span",
        "columns",
        "Ts",
        "resample",
        "tag",
        "loops",
    ),
    "Plug-ins": (
        "plugin",
        "valve_plugin",
        "effect_plugin",
        "plant_plugin",
        "controller_plugin",
    ),
    "Execution": ("jobs", "backend", "address", "resume", "seed", "fresh_seeds"),
    "Output": (
        "out",
        "as_json",
        "html",
        "csv",
        "picture",
        "report",
        "to",
        "markdown",
        "why",
        "full",
        "write_loop",
    ),
}


def group_of(name: str) -> str:
    """Return the heading under which an option's help is printed."""
    return next((heading for heading, names in GROUPS.items() if name in names), COMMON)


class GroupedCommand(TyperCommand):
    """A verb whose help lists its options under headings, and that says what an interrupt met."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb; the command-line library would turn Ctrl-C into a bare exit code."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            met = " ".join(["interrupted", describe_judging()]).rstrip()
            print(masked(stop) or met, file=sys.stderr)
            raise Exit(130) from None

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments first, then the options of each group."""
        # The options by their headings
        listed: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                is_option = parameter.param_type_name == "option"
                if is_option:
                    heading = group_of(parameter.name or "")
                else:
                    heading = "Arguments"
                listed.setdefault(heading, []).append(record)

        # Headings in a fixed order; how a record is read is explained at one verb
        for heading in ("Arguments", COMMON, *GROUPS):
            if heading not in listed:
                continue
            with formatter.section(heading):
                if heading == _READING and self.name != _EXPLAINS:
                    names = ", ".join(option.partition(" ")[0] for option, _ in listed[heading])
                    formatter.write_text(f"{names}: see simbench {_EXPLAINS} --help.")
                else:
                    formatter.write_dl(listed[heading])

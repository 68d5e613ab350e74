"""What a detector is given: every field and function of `prepared`, from its docstrings."""

from __future__ import annotations

import inspect
from functools import cached_property

from text import heading, plain, table

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord

_INTRODUCTION = (
    "A detector is a function ``detect(prepared)``. ``prepared.record`` is the record as it is"
    " judged; the rest is worked out when first asked for, once for all methods of one record."
    " ``simbench contract FILE.py`` checks what a detector makes of it."
)


_INNER = ("seen_by", "with_mv")  # what a runner calls


def prepared_page() -> str:
    """Return the page on what `prepared` offers a detector."""
    rows, calls = [], []
    for name, member in vars(Prepared).items():
        if name.startswith("_") or name in _INNER:
            continue
        if isinstance(member, (property, cached_property)):
            function = member.fget if isinstance(member, property) else member.func
            rows.append((f"``prepared.{name}``", plain(_first(function))))
        elif inspect.isfunction(member):
            words = [p for p in inspect.signature(member).parameters if p != "self"]
            calls.append((f"``prepared.{name}({', '.join(words)})``", plain(_first(member))))
    record = [(f"``prepared.record.{name}``", plain(text)) for name, text in _record_fields()]
    return "\n".join(
        [
            *heading("What a detector is given"),
            _INTRODUCTION,
            "",
            *heading("The record", "-"),
            *table(("field", "what it is"), record),
            *heading("What is known of it", "-"),
            *table(("value", "what it is"), rows),
            *heading("Signals made ready", "-"),
            *table(("call", "what it returns"), calls),
        ]
    )


def _first(function: object) -> str:
    """Return the whole docstring in one paragraph."""
    return " ".join((inspect.getdoc(function) or "").split())


def _record_fields() -> list[tuple[str, str]]:
    """Return the parameters of a record with their meaning, as its docstring has them."""
    text = inspect.getdoc(LoopRecord) or ""
    part = text.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    fields: list[tuple[str, str]] = []
    for line in part.splitlines():
        if line and not line.startswith(" "):
            names, _, kind = line.partition(" : ")
            fields.append((names.strip(), kind))
        elif fields:
            name, said = fields[-1]
            fields[-1] = (name, f"{said} {line.strip()}".strip())
    return fields

"""reStructuredText: plain words, headings, tables."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def plain(text: object) -> str:
    """Return a text in one line in which nothing is markup but what is in backticks, which is
    code.
    """
    words = re.split(r"`([^`]+)`", " ".join(str(text).split()))
    code = [
        f"``{part}``" if i % 2 else re.sub(r"([\\*|_])", r"\\\1", part)
        for i, part in enumerate(words)
    ]
    # markup must stand free: an escaped space is none on the page
    return "\\ ".join(part for part in code if part)


def heading(text: str, line: str = "=") -> list[str]:
    """Return a title, its line and an empty one."""
    return [text, line * len(text), ""]


def table(head: Sequence[str], rows: Iterable[Sequence[object]], widths: str = "auto") -> list[str]:
    """Return a table whose cells are markup already."""
    lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {widths}", ""]
    for row in (head, *rows):
        for i, cell in enumerate(row):
            lines.append(f"   {'*' if i == 0 else ' '} - {cell}".rstrip())
    return [*lines, ""]

"""Show tables: as lines of text, or in a notebook below a sentence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def page_part(sentence: str, frame: pd.DataFrame) -> str:
    """Return a sentence and a table as HTML.

    >>> import pandas as pd
    >>> page_part("S < 5", pd.DataFrame({"S": [1.23456]})).split("</p>")[0]
    '<p>S &lt; 5'
    """
    table = frame.to_html(
        index=False, border=0, na_rep="", float_format=lambda x: f"{x:.3g}", max_rows=60
    )
    return f"<p>{escape(sentence)}</p>{table}"


def columns(lines: Sequence[Sequence[str]], right: Collection[str] = ()) -> list[str]:
    """Return cells as lines of equal columns, the head first; those headed by one of `right` are
    flush right.

    >>> columns([("a", "b"), ("long", "c")])
    ['a     b', 'long  c']
    """
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    sides = [str.rjust if head in right else str.ljust for head in lines[0]]
    padded = []
    for line in lines:
        padded.append(
            "  ".join(
                side(cell, w) for side, cell, w in zip(sides, line, widths, strict=True)
            ).rstrip()
        )
    return padded

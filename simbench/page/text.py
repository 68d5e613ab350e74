"""Text of an answer for a terminal: sentences and tables of 100 columns."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from simbench.detectors.views import columns

if TYPE_CHECKING:
    import pandas as pd

LINE_WIDTH = 100  # characters of a line


def wrap(text: str) -> list[str]:
    """Return a sentence in lines of the width of the tables.

    >>> [len(line) for line in wrap("word " * 30)]
    [99, 49]
    """
    return textwrap.wrap(text, LINE_WIDTH)


def lines_of(frame: pd.DataFrame) -> list[str]:
    """Return a table of texts as lines of equal columns, its head first; nothing of an empty one.

    >>> import pandas as pd
    >>> lines_of(pd.DataFrame({"method": ["he", "horch"], "n": ["12", "9"]}))
    ['method  n', 'he      12', 'horch   9']
    """
    rows = [tuple(map(str, row)) for row in frame.itertuples(index=False, name=None)]
    if rows:
        return columns([list(frame.columns)] + rows)
    return []

"""Show results in a notebook as one sentence above one table."""

from __future__ import annotations

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

"""What the pages of this room share: sections out of sentences, tiles, pictures and tables, and the
writing of the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.files import whole_file
from simbench.html.page import render
from simbench.html.svg import inline_svg
from simbench.html.table import sortable

ROOM = "simbench.plant"


def section(
    name: str,
    title: str,
    paragraphs: Sequence[str] = (),
    *,
    tiles: Sequence[tuple[str, str]] = (),
    pictures: Sequence[tuple[Figure, str]] = (),
    table: pd.DataFrame | None = None,
    long: Sequence[str] = (),
    beside: dict[str, Sequence[str]] | None = None,
    matrix: bool = False,
    points: Sequence[str] = (),
) -> dict[str, Any]:
    """Return one section of a page."""
    drawn = [
        {"svg": inline_svg(f, f"{name}-{i}", says), "caption": says}
        for i, (f, says) in enumerate(pictures)
    ]
    body: Markup = render(
        ROOM, "section.html", paragraphs=paragraphs, tiles=tiles, pictures=drawn, points=points,
        table=None if table is None else sortable(table, long=long, beside=beside, matrix=matrix),
    )  # fmt: skip
    return {"id": name, "title": title, "body": body}


def write(path: str | Path, title: str, subtitle: str, sections: Sequence[dict[str, Any]]) -> None:
    """Write a self-contained page, readable in light and dark and on a phone."""
    footer = f"simbench {version('stiction-simbench')}"
    text = render(
        ROOM, "page.html", title=title, subtitle=subtitle, sections=list(sections), footer=footer
    )
    with whole_file(path) as f:
        f.write(text)

"""What the pages about records share: sections with sentences, tiles, pictures and
tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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

_ROOM = "simbench.html"


@dataclass(frozen=True)
class SectionTable:
    """A table of a section: which columns hold long text, and which hold shares (written with two
    decimals).
    """

    frame: pd.DataFrame
    long: Sequence[str] = ()
    shares: Sequence[str] = ()


def section(
    name: str,
    title: str,
    paragraphs: Sequence[str] = (),
    *,
    tiles: Sequence[tuple[str, str]] = (),
    pictures: Sequence[tuple[Figure, str]] = (),
    table: SectionTable | None = None,
    points: Sequence[str] = (),
) -> dict[str, Any]:
    """Return one section of a page: paragraphs, tiles, pictures with captions, a table, a list."""
    drawn = [
        {"svg": inline_svg(f, f"{name}-{i}", caption), "caption": caption}
        for i, (f, caption) in enumerate(pictures)
    ]
    rows = None
    if table is not None:
        rows = sortable(
            table.frame,
            dict.fromkeys(table.shares, "{:.2f}".format),
            table.long,
        )
    body: Markup = render(
        _ROOM,
        "section.html",
        paragraphs=paragraphs,
        tiles=tiles,
        pictures=drawn,
        points=points,
        table=rows,
    )
    return {"id": name, "title": title, "body": body}


def write(path: str | Path, title: str, subtitle: str, sections: Sequence[dict[str, Any]]) -> None:
    """Write a self-contained page, readable in light and dark and on a phone."""
    about = {"title": title, "subtitle": subtitle, "sections": list(sections)}
    footer = f"simbench {version('stiction-simbench')}"
    with whole_file(path) as f:
        f.write(render(_ROOM, "page.html", **about, footer=footer))

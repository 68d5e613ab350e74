"""A page as a document: sections of text, tiles, lists, tables, pictures and commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.files import whole_file
from simbench.html.page import render
from simbench.html.svg import inline_svg
from simbench.html.table import sortable


@dataclass(frozen=True)
class Text:
    """A paragraph, or a heading within a section."""

    text: str
    look: Literal["", "strong", "good", "bad", "heading"] = ""
    kind = "text"


@dataclass(frozen=True)
class Tiles:
    """Numbers that are read first, each with what it is."""

    items: Sequence[tuple[str, str]]
    kind = "tiles"


@dataclass(frozen=True)
class Points:
    """A list."""

    items: Iterable[str]
    kind = "points"


@dataclass(frozen=True)
class Table:
    """A table that can be sorted: how its columns are written, which hold long text, and what
    stands small beside the values of a column.
    """

    frame: pd.DataFrame
    formats: Mapping[str, Callable[[Any], str]] = field(default_factory=dict)
    long: Sequence[str] = ()
    beside: Mapping[str, Sequence[str]] = field(default_factory=dict)
    kind = "table"


@dataclass(frozen=True)
class Pictures:
    """Pictures, each with what it shows; small ones stand side by side, a wide one by itself."""

    items: Iterable[tuple[Figure, str]]
    wide: bool = False
    kind = "pictures"


@dataclass(frozen=True)
class Commands:
    """Lines to be copied."""

    lines: Iterable[str]
    kind = "commands"


@dataclass(frozen=True)
class Details:
    """Parts that are shown when their summary is opened."""

    summary: str
    parts: Sequence[Part]
    kind = "details"


Part = Text | Tiles | Points | Table | Pictures | Commands | Details


@dataclass(frozen=True)
class Section:
    """A section: the id of its anchor, its title, and its parts; without parts it is not shown."""

    name: str
    title: str
    parts: Sequence[Part]


def texts(lines: Iterable[str], look: Literal["", "strong"] = "") -> list[Part]:
    """Return lines as paragraphs."""
    return [Text(line, look) for line in lines]


def two_digits(*columns: str) -> dict[str, Callable[[Any], str]]:
    """Return formats that write columns with two decimals, as shares are."""
    return dict.fromkeys(columns, "{:.2f}".format)


def write(
    path: str | Path, title: str, subtitle: str, sections: Iterable[Section], footer: str = ""
) -> None:
    """Write a self-contained page, readable in light and dark and on a phone."""
    text = render(
        "page.html",
        title=title,
        subtitle=subtitle,
        sections=[
            {"id": s.name, "title": s.title, "body": as_html(s.parts, s.name)}
            for s in sections
            if s.parts
        ],
        footer=footer or f"simbench {version('stiction-simbench')}",
    )
    with whole_file(path) as f:
        f.write(text)


def as_html(parts: Sequence[Part], name: str) -> Markup:
    """Return the parts of a section as HTML; `name` begins the ids of what its pictures hold."""
    return Markup().join(_render_part(part, f"{name}-{i}") for i, part in enumerate(parts))


def _render_part(part: Part, name: str) -> Markup:
    values: dict[str, Any] = dict(vars(part))
    if isinstance(part, Table):
        values = {"table": sortable(part.frame, part.formats, part.long, part.beside)}
    elif isinstance(part, Pictures):
        drawn = enumerate(part.items)
        values["items"] = [(inline_svg(f, f"{name}-{i}", says), says) for i, (f, says) in drawn]
    elif isinstance(part, Details):
        values["body"] = as_html(part.parts, name)
    return render("part.html", kind=part.kind, **values)

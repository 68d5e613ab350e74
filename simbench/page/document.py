"""A page as a document: sections of text, lists, tables, pictures and commands."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from html import escape
from importlib.metadata import version
from pathlib import Path, PurePath
from typing import Any, Literal

import matplotlib
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from simbench.detectors.errors import printable
from simbench.files import whole_file

_Format = Callable[[Any], str]


@dataclass(frozen=True)
class Text:
    """A paragraph, or a heading within a section."""

    text: str
    look: Literal["", "strong", "good", "bad", "heading"] = ""
    kind = "text"


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


Part = Text | Points | Table | Pictures | Commands | Details


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
    # the page whole, then the file
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
        values = {"columns": sortable(part), "rows": len(part.frame)}
    elif isinstance(part, Pictures):
        drawn = enumerate(part.items)
        values["items"] = [(inline_svg(f, f"{name}-{i}", says), says) for i, (f, says) in drawn]
    elif isinstance(part, Details):
        values["body"] = as_html(part.parts, name)
    return render("part.html", kind=part.kind, **values)


@cache
def _template_environment() -> Environment:
    """Return the templates; texts are escaped, a missing value is an error."""
    return Environment(
        loader=PackageLoader("simbench.page", "templates"),
        autoescape=True,
        finalize=_escape_hidden,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _escape_hidden(value: Any) -> Any:
    """Escape what a browser would not show of a text that is not yet a part of a page."""
    plain = isinstance(value, (str, PurePath)) and not isinstance(value, Markup)
    if plain and not str(value).isprintable():
        return printable(value, "\n\t")
    return value


def render(template: str, **values: Any) -> Markup:
    """Fill one template."""
    return Markup(_template_environment().get_template(template).render(**values))


def inline_svg(figure: Figure, name: str, caption: str) -> Markup:
    """Return a figure as an <svg> element for an HTML page, for which alone it was drawn: pyplot
    keeps it no longer.
    """
    # draw it on no ground of its own
    figure.patch.set_alpha(0.0)
    for axes in figure.axes:
        axes.patch.set_alpha(0.0)
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close(figure)

    # keep the element alone, in one line
    text = re.sub(r"\s+", " ", buffer.getvalue()).replace("> <", "><")
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text)

    # black follows the page's text colour and white its ground, so that one picture serves light
    # and dark
    text = re.sub(r"(stroke|fill): #000000", r"\1: currentColor", text)
    text = re.sub(r"(stroke|fill): #ffffff", r"\1: var(--page)", text)

    # ids are unique within one picture only
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)

    # as wide as its place, at most half as wide again as drawn
    width = re.search(r'viewBox="0 0 ([\d.]+)', text)
    if width:
        wide = float(width.group(1))
    else:
        wide = 400.0
    head = (
        f'<svg role="img" aria-label="{escape(caption, quote=True)}"'
        f' style="max-width:{wide * 1.5:.0f}px" '
    )
    text = re.sub(r'<svg ([^>]*?)(width|height)="[^"]*"', r"<svg \1", text, count=1)
    text = re.sub(r'<svg ([^>]*?)(width|height)="[^"]*"', r"<svg \1", text, count=1)
    return Markup(text.replace("<svg ", head, 1))


def sortable(part: Table) -> list[dict[str, Any]]:
    """Return the columns of a table as part.html draws them: name, kind, and of each value its
    text, what stands small beside it, and the number that it is sorted by.
    """
    # What kind of column it is
    columns = []
    named = False
    for name, values in part.frame.items():
        # numbers are flush right; the first other column stays in view when the rest is scrolled
        kind = ""
        if pd.api.types.is_numeric_dtype(values) and values.dtype != bool:
            kind = "n"
        elif name in part.long:
            kind = "long"
        elif not named:
            kind = "name"
            named = True

        # each value as text
        keys = [None] * len(values)
        if kind == "n":
            keys = ["" if pd.isna(value) else repr(float(value)) for value in values]
        texts = [_format_value(value, part.formats.get(str(name))) for value in values]
        small = part.beside.get(str(name), [""] * len(values))
        cells = list(zip(texts, small, keys, strict=True))
        columns.append({"name": str(name), "kind": kind, "cells": cells})
    return columns


def _format_value(value: Any, how: _Format | None) -> str:
    """Return a value as it is asked for, a number with three digits, nothing of one that lacks."""
    if value is None or value is pd.NA or value != value:
        return ""
    if how is not None:
        return how(value)
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)

"""Fill the templates of HTML pages."""

from functools import cache
from pathlib import PurePath
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from simbench.detectors.errors import printable


@cache
def _environment() -> Environment:
    """Return the templates; texts are escaped, a missing value is an error."""
    return Environment(
        loader=PackageLoader("simbench.html", "templates"),
        autoescape=True,
        finalize=_escape_hidden,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _escape_hidden(value: Any) -> Any:
    """Escape what a browser would not show of a text that is not yet a part of a page."""
    plain = isinstance(value, (str, PurePath)) and not isinstance(value, Markup)
    return printable(value, "\n\t") if plain and not str(value).isprintable() else value


def render(template: str, **values: Any) -> Markup:
    """Fill one template."""
    return Markup(_environment().get_template(template).render(**values))

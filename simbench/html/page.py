"""Load the templates of HTML pages: those of one package, and those that all pages share."""

from functools import cache
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup


@cache
def _environment(room: str) -> Environment:
    """Return the templates of a package and the shared ones; texts are escaped, a missing value
    is an error.
    """
    loader = ChoiceLoader(
        [PackageLoader(room, "templates"), PackageLoader("simbench.html", "templates")]
    )
    return Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(room: str, template: str, **values: Any) -> Markup:
    """Fill one template."""
    return Markup(_environment(room).get_template(template).render(**values))

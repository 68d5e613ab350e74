"""Templates of the report."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup


@cache
def environment() -> Environment:
    """Return the templates; every text is escaped, a missing value is an error."""
    loader = PackageLoader("simbench.report", "templates")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def render(template: str, **values: Any) -> Markup:
    """Fill one template.

    Parameters
    ----------
    template : str
        File in simbench/report/templates.
    **values
        What it speaks of.

    Returns
    -------
    markupsafe.Markup
    """
    return Markup(environment().get_template(template).render(**values))

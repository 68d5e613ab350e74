"""The site: API and detectors from their own docstrings; built by `make site`, warnings are errors."""

from __future__ import annotations

import inspect
import re
from importlib.metadata import version as installed
from pathlib import Path

import detectors
import scenarios
import simbench
from detectors.registry import methods

project, author = "simbench", "the simbench authors"
version = release = installed("stiction-simbench")
extensions = ["sphinx.ext.autodoc", "numpydoc"]
numpydoc_show_class_members = False
autodoc_typehints = "none"
html_theme = "alabaster"
html_theme_options = {"description": "Which stiction detector can be trusted, and why the simulation is unlike the plant"}
html_show_sourcelink = False
exclude_patterns = ["generated/.*"]

PARTS = ("Needs", "Parameters", "Indices", "Rule", "Not for", "Source")


def plain(text: str) -> str:
    """Return a text in which nothing is markup."""
    return re.sub(r"([\\*`|_])", r"\\\1", " ".join(text.split()))


def detector_page() -> str:
    """Write what every detector says of itself: what it needs, when not to use it, where it comes from."""
    lines = ["Which detector when", "===================", "", "From each method's own file.", ""]
    for name in methods.names():
        module = methods.load(name)
        text = (module.__doc__ or "").split("Example", 1)[0]
        found = re.split(rf"^({'|'.join(PARTS)}):", text, flags=re.MULTILINE)
        lines += [name, "-" * len(name), "", plain(found[0]), ""]
        lines += [f":{part}: {plain(says)}" for part, says in zip(found[1::2], found[2::2])]
        lines += [""]
    return "\n".join(lines)


def api_page() -> str:
    """Write one entry per public name of the three packages."""
    lines = ["API", "===", ""]
    for package in (simbench, simbench.gap, detectors, scenarios):
        title = f"import {package.__name__}"
        lines += [title, "-" * len(title), "", f".. currentmodule:: {package.__name__}", ""]
        for name in sorted(package.__all__):
            thing = getattr(package, name)
            if inspect.isclass(thing):
                lines += [f".. autoclass:: {name}", "   :members:", "   :no-index:" if package is not simbench else "", ""]
            elif not inspect.ismodule(thing):
                lines += [f".. autofunction:: {name}", ""]
    return "\n".join(lines)


folder = Path(__file__).parent / "generated"
folder.mkdir(exist_ok=True)
for page, content in (("detectors", detector_page()), ("api", api_page())):
    (folder / f"{page}.rst").write_text(content, encoding="utf-8")

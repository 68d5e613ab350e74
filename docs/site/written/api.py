"""API: a page for every public name, and one that lists them."""

from __future__ import annotations

import importlib
import inspect
from types import ModuleType

from text import heading, plain, table

PACKAGES = ("simbench", "simbench.gap", "simbench.detectors", "simbench.scenarios")
# what a plug-in's author calls in addition to them
FURTHER = {
    "simbench.detectors.judge": ("judge",),
    "simbench.figures": ("make_figures", "draw_path"),
    "simbench.scenarios.grid": ("load_grid",),
}


def public() -> dict[str, tuple[str, ...]]:
    """Return the public names by package."""
    modules = {name: importlib.import_module(name) for name in PACKAGES}
    return {
        name: tuple(n for n in sorted(m.__all__) if not _is_module(m, n))
        for name, m in modules.items()
    } | FURTHER


def api_pages() -> dict[str, str]:
    """Return the pages by name, "api" and one for each public name."""
    pages, seen = {}, {}
    lines = [*heading("API"), "Every public name; each has a separate page.", ""]
    for package, names in public().items():
        rows = []
        for name in names:
            thing = getattr(importlib.import_module(package), name)
            # a room that is called: its function of the same name answers
            if inspect.ismodule(thing):
                thing = inspect.unwrap(
                    getattr(importlib.import_module(vars(thing)["ANSWERED_BY"]), name)
                )
            full = f"{package}.{name}"
            first = seen.setdefault(id(thing), full)
            if first == full:
                pages[f"api/{full}"] = _page(package, name, thing)
            rows.append(
                (
                    f":doc:`{name} <api/{first}>`",
                    plain((inspect.getdoc(thing) or "").split("\n\n")[0]),
                )
            )
        lines += [*heading(f"import {package}", "-"), *table(("name", "what it is"), rows, "25 75")]
    hidden = [
        *heading("All pages", "-"),
        ".. toctree::",
        "   :maxdepth: 1",
        "",
        *(f"   {page}" for page in pages),
    ]
    return {"api": "\n".join([*lines, *hidden, ""]), **pages}


def _page(package: str, name: str, thing: object) -> str:
    kind = "autoclass" if inspect.isclass(thing) else "autofunction"
    # the package of that name comes before it
    home = thing.__module__ if name == "confirm" else package
    lines = [*heading(f"{package}.{name}"), f".. currentmodule:: {home}", "", f".. {kind}:: {name}"]
    return "\n".join([*lines, *(["   :members:"] if kind == "autoclass" else []), ""])


def _is_module(module: ModuleType, name: str) -> bool:
    thing = getattr(module, name)
    return inspect.ismodule(thing) and not callable(thing)

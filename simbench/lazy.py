"""Load the public names of a package when they are first used; the package's stub (.pyi) is the
only list of them.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


def attach(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` for a package whose public names stand in its
    stub.
    """
    # A wrong name raises AttributeError with the nearest right one.
    lines = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8")).body
    homes = {}
    for line in lines:
        if isinstance(line, ast.ImportFrom):
            for a in line.names:
                if a.asname:
                    homes[a.name] = str(line.module)
    names = sorted(homes)

    def load(name: str) -> Any:
        if name == "__version__":
            from importlib.metadata import version

            return version("stiction-simbench")
        if name not in homes:
            raise AttributeError(_unknown_attribute(package, name, names))
        home = homes[name]
        if home == package:
            return import_module(f"{home}.{name}")
        return getattr(import_module(home), name)

    return (
        load,
        lambda: names + ["__all__", "__doc__", "__file__", "__name__", "__path__", "__version__"],
        names,
    )


def called_as(package: str, home: str) -> None:
    """Let a package be called like the public function of the same name, which `home` holds:
    `simbench.confirm(record)` is `simbench.gap.gain_pair.confirm(record)`, whichever was
    imported first.
    """

    class _Room(ModuleType):
        def __call__(self, *arguments: Any, **settings: Any) -> Any:
            function = getattr(import_module(home), package.rpartition(".")[2])
            return function(*arguments, **settings)

    room = sys.modules[package]
    room.__class__ = _Room
    vars(room)["ANSWERED_BY"] = home


def _unknown_attribute(package: str, name: str, names: list[str]) -> str:
    if name.startswith("_"):  # a notebook's probes are no typing errors
        return f"module {package!r} has no attribute {name!r}"
    from simbench.detectors.errors import nearest

    return f"module {package!r} has no attribute {name!r}: {nearest(name, names)}"

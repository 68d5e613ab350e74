"""Let `import detectors` mean `simbench.detectors`, and `scenarios` alike: plug-ins and scripts may
use the short names.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

_PACKAGES = ("detectors", "scenarios")


class _ShortNames:
    """Find the modules of `simbench.detectors` under their short names: each is one module, so that
    its classes stay one class.
    """

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, _: Any = None) -> ModuleSpec | None:
        package, _, inside = name.partition(".")
        if package not in _PACKAGES or inside.endswith("__main__"):
            return None
        if inside:
            ours = sys.modules.get(package) is sys.modules.get(f"simbench.{package}", _ShortNames)
            return ModuleSpec(name, _ShortNames, is_package=True) if ours else None
        found = PathFinder.find_spec(name)  # a package of the user goes first
        others = found is not None and found.origin is not None
        return None if others else ModuleSpec(name, _ShortNames, is_package=True)

    @staticmethod
    def create_module(_: ModuleSpec) -> None:
        return None

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        sys.modules[module.__name__] = import_module(f"simbench.{module.__name__}")


def allow_short_names() -> None:
    """Make the short names known to this process."""
    if _ShortNames not in sys.meta_path:
        sys.meta_path.insert(0, _ShortNames)

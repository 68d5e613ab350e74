"""What to try: loops and scenarios as numbers and names, and grids of them in TOML."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from simbench.scenarios.errors import SpecError

if TYPE_CHECKING:
    from simbench import Loop, load_loop
    from simbench.scenarios.spec import Scenario

__all__ = ["Loop", "Scenario", "SpecError", "load_loop"]


def __getattr__(name: str) -> Any:
    """Load what needs pydantic when it is first asked for; a loop is the one that simulates
    itself.
    """
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import simbench
    from simbench.scenarios import spec

    return getattr(simbench if name in ("Loop", "load_loop") else spec, name)


def __dir__() -> list[str]:
    """List the names that are loaded when first asked for, so that they are completed too."""
    return sorted({*globals(), *__all__})

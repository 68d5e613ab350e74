"""The blind check: records with hidden effects from an independent generator, sealed answers, and their scoring."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simbench.gap.withheld.answering import answer
    from simbench.gap.withheld.making import Plan, make
    from simbench.gap.withheld.opening import open_

__all__ = ["Plan", "answer", "make", "open_"]

_HOME = {"make": "making", "Plan": "making", "answer": "answering", "open_": "opening"}


def __getattr__(name: str) -> Any:
    """Import what is asked for: the answering processes must not wait for the generator's compiler."""
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""The error of this package: one sentence about what is wrong in a loop or grid file."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class SpecError(ValueError):
    """A loop or grid that cannot be what its author meant."""


def suggestion(word: str, known: Iterable[str]) -> str:
    """Say which known words come nearest to a wrong one."""
    names = sorted(known)
    close = get_close_matches(word, names, n=2, cutoff=0.5) or get_close_matches(
        word.lower(), [k.lower() for k in names], 1
    )
    close = [k for k in names if k in close or k.lower() in close]
    if close:
        return f"did you mean {' or '.join(map(repr, close))}?"
    return f"known: {', '.join(names)}"

"""A library without some effects, as if their files had gone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from simbench.gap.effects import PLUGINS, recogniser


@contextmanager
def left_out(*effects: str) -> Iterator[None]:
    """Have nobody recognise some effects while the block lasts."""
    kept = [name for name in PLUGINS.names() if name not in effects]
    try:
        with patch.object(PLUGINS, "names", lambda: kept):
            recogniser.cache_clear()
            yield
    finally:
        recogniser.cache_clear()

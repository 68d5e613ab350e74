"""Numbers of each figure, computed once for all tests."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from simbench.catalogue import FIGURES

REAL = Path(__file__).parents[4] / "shared" / "data" / "real"


@pytest.fixture(scope="session")
def drawn():
    """Return a function: figure module name -> the numbers it draws (of the real records, where it
    needs them).
    """

    @functools.cache
    def numbers(name: str, *given):
        return FIGURES.load(name).data(*given)

    return numbers

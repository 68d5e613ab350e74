"""Numbers of each figure, computed once for all tests."""

import fcntl
import functools
import os
import pickle
from pathlib import Path

import pytest

from simbench.figures._folder import FIGURES

REAL = Path(__file__).parents[4] / "shared" / "data" / "real"


@pytest.fixture(scope="session")
def drawn(tmp_path_factory):
    """Return a function: figure module name -> the numbers it draws (of the real records, where it
    needs them).
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "figures-drawn"
    folder.mkdir(exist_ok=True)

    @functools.cache
    def numbers(name: str, *given):
        kept = folder / f"{name}{len(given)}"
        with open(kept.with_suffix(".lock"), "w") as lock:
            # of two workers that ask for a figure the first computes it, the other waits
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                kept.write_bytes(pickle.dumps(FIGURES.load(name).data(*given)))
        return pickle.loads(kept.read_bytes())

    return numbers

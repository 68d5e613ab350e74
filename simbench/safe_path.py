"""Start worker processes that import nothing from the working directory, which may be a folder of
data with a `joblib.py` in it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

VARIABLE = (
    "PYTHONSAFEPATH"  # as `python -P`: neither -m nor -c put the working directory on the path
)


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Let every Python process that is started meanwhile leave the working directory off its
    path.
    """
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(VARIABLE, None)
        else:
            os.environ[VARIABLE] = before

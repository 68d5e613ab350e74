"""Work calls in worker processes, with progress: their answers in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from joblib import Parallel

from simbench.progress import Progress
from simbench.safe_path import safe_path


def run_parallel(calls: Sequence[Any], jobs: int, desc: str) -> list[Any]:
    """Return what calls (of `joblib.delayed`) give, in order, worked by so many processes."""
    with safe_path(), Parallel(n_jobs=jobs, return_as="generator") as parallel:
        return list(Progress(parallel(calls), total=len(calls), desc=desc, delay=1.0))

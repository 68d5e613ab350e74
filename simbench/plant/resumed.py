"""Many questions answered side by side; a call that was killed goes on where it stopped."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from joblib import Memory, Parallel, delayed
from tqdm import tqdm

from simbench.files import folder


def resumed(
    ask: Callable[..., Any], about: Sequence[tuple[Any, ...]], *, jobs: int, keep: str | Path | None, what: str
) -> list[Any]:
    """Ask of each in turn, in several processes, and return the answers in order.

    Parameters
    ----------
    ask : function
        Of a module; what it is asked about decides its answer.
    about : sequence of tuple
        Its arguments, one tuple a question.
    jobs : int
        Processes; -1 = all cores.
    keep : path, optional
        Folder in which answers are kept; those of another version of the package are not used.
    what : str
        Named beside the progress.

    Returns
    -------
    list

    Raises
    ------
    FileError
        When the folder cannot be made.

    Examples
    --------
    >>> resumed(max, [(1, 2), (4, 3)], jobs=1, keep=None, what="larger ones")
    [2, 4]
    """
    # processes that live on from another call may stand in another folder
    one = ask if keep is None else Memory(folder(Path(keep).absolute() / version("stiction-simbench")), verbose=0).cache(ask)
    with Parallel(n_jobs=min(jobs, max(len(about), 1)) if jobs > 0 else jobs, return_as="generator") as parallel:
        answers = parallel(delayed(one)(*a) for a in about)
        return list(tqdm(answers, total=len(about), file=sys.stderr, desc=what))

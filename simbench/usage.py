"""Handle the errors of every command line: print one sentence on stderr and return an exit code,
without a traceback.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from simbench.detectors.usage import exit_code as of_detectors
from simbench.scenarios.errors import SpecError


def exit_code(work: Callable[[], int | None], command: Sequence[str] = ()) -> int:
    """Run a command and return its exit code, as `simbench.detectors.usage.exit_code`; the errors
    of loop files are known too.
    """
    return of_detectors(work, SpecError, command=command)

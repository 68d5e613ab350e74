"""Say in one sentence what an error means to the user, and keep the traceback of a fault of the
program in a log file.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

from simbench.detectors.errors import UserError, masked

LOG = (  # begins the name of a fault's log, in the system's folder of temporary files
    "simbench-fault-"
)
# set where tests run: a fault of the program is a traceback there, no sentence
RAISED = "SIMBENCH_RAISE"
LOGS = 20  # kept there, the newest
# the detector that is asked in this process, and the record that it is asked about, in words
JUDGING: dict[str, str] = {}


def describe_judging() -> str:
    """Return which detector an interrupt met, and about which record it was asked; "" where none
    was.
    """
    if "detector" not in JUDGING:
        return ""
    return f"while {JUDGING['detector']} judged {JUDGING.get('record', 'a record')}"


def sentence_of(error: Exception, command: Sequence[str] = ()) -> str:
    """Return what to tell the user of an error: what is wrong, or that the program is at fault.

    Whoever answers for many records lists the sentence of one, and goes on with the others.
    """
    # Errors that users cause say so themselves
    if isinstance(error, UserError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory for this; ask for fewer samples or scenarios"

    # What the operating system refuses
    if isinstance(error, OSError):
        kind = {
            NotADirectoryError: "; a folder is needed",
            IsADirectoryError: "; a file is needed",
        }.get(type(error), "")
        return f"{error.filename or 'output'}: {(error.strerror or str(error)).lower()}{kind}"
    if isinstance(error, RuntimeError) and str(error).startswith("Symlink loop"):
        return f"{error}; a path that leads to a file or folder is needed"

    # Everything else is a fault of the program
    return _log_fault(error, command)


def _log_fault(error: Exception, command: Sequence[str]) -> str:
    """Write the traceback of an error nobody foresaw to a log file, and return the sentence that
    names it.
    """
    if os.environ.get(RAISED):
        raise error

    # what pydantic writes is for programmers; the log has it
    by_pydantic = type(error).__module__.startswith("pydantic")
    message = type(error).__name__ + ("" if by_pydantic else f": {error}")
    message = " ".join(message.split())[:200]
    try:
        handle, log = tempfile.mkstemp(prefix=LOG, suffix=".log")
        with open(handle, "w", encoding="utf-8", errors="backslashreplace") as f:
            f.write(masked(f"{sys.argv}\n\n{''.join(traceback.format_exception(error))}"))
        _drop_old_logs(Path(log).parent)
    except OSError:
        log = "no log file, as none could be written"
    if command:
        asked = f"`{shlex.join(command)}`"
    else:
        asked = "this record"
    return (
        f"{asked} met a fault of the program itself ({message}); no result of it is valid;"
        f" the traceback is in {log}"
    )


def _drop_old_logs(folder: Path) -> None:
    """Remove all logs of faults but the newest; what cannot be removed is let be."""
    with contextlib.suppress(OSError):  # a log that went meanwhile has no time
        for log in sorted(folder.glob(f"{LOG}*.log"), key=lambda p: p.stat().st_mtime_ns)[:-LOGS]:
            with contextlib.suppress(OSError):
                log.unlink()

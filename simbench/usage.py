"""What every command line here does with an error: one sentence on stderr and an exit code, never a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable

from detectors.errors import UserError
from scenarios.errors import SpecError


def exit_code(work: Callable[[], int | None]) -> int:
    """Run a command and return its exit code.

    Parameters
    ----------
    work : function () -> int or None

    Returns
    -------
    int
        The command's own (None: 0); 2 wrong usage, file or configuration, said in one sentence on stderr; 130 interrupted.

    Examples
    --------
    >>> exit_code(lambda: None), exit_code(lambda: 1)
    (0, 1)
    """
    try:
        return int(work() or 0)
    except (UserError, SpecError) as error:
        return complain(str(error))
    except MemoryError:
        return complain("not enough memory for this; ask for fewer samples or scenarios")
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:
        return complain(f"{error.filename or 'output'}: {(error.strerror or str(error)).lower()}")
    except KeyboardInterrupt as error:
        print(str(error) or "interrupted", file=sys.stderr)
        return 130


def complain(sentence: str) -> int:
    """Print one sentence to stderr and return the exit code of wrong usage, 2.

    Parameters
    ----------
    sentence : str

    Returns
    -------
    int
    """
    print(f"error: {' '.join(sentence.split())}", file=sys.stderr)
    return 2

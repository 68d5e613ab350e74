"""A contract checked in a process of its own: a plug-in that ends it, never answers or takes all memory is named."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from detectors.contract.detector import Contract
from detectors.errors import ParameterError, UserError
from detectors.plugins.host import BYTES
from scenarios.errors import SpecError
from simbench.contract import check_file, kind_of

SECONDS = 600.0  # for all that is asked of one plug-in


def check_apart(path: str | Path, seconds: float = SECONDS) -> Contract:
    """Check one file as `check_file` does, in another process.

    Parameters
    ----------
    path : str or Path
        The file.
    seconds : float
        Time it may take in all.

    Returns
    -------
    Contract

    Raises
    ------
    ParameterError, SpecError
        As `check_file`.

    Examples
    --------
    >>> from simbench.loop.valves import ideal
    >>> check_apart(ideal.__file__).kept
    True
    """
    kind = kind_of(path)
    with tempfile.TemporaryFile() as answer:
        process = subprocess.Popen(
            [sys.executable, "-m", "simbench.contract.apart", str(answer.fileno()), str(BYTES), str(path)],
            pass_fds=(answer.fileno(),), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        try:
            code = process.wait(seconds)
        except subprocess.TimeoutExpired:
            return Contract(kind, Path(path).stem, (f"takes longer than {seconds:g} s",))
        finally:
            with contextlib.suppress(OSError):  # all that it started
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        answer.seek(0)
        said = answer.read()
    try:
        found = json.loads(said)
    except ValueError:
        way = f"signal {-code}" if code < 0 else f"exit status {code}"
        return Contract(kind, Path(path).stem, (f"ends its process ({way})",))
    if "refused" in found:
        raise ParameterError(found["refused"])
    return Contract(kind, Path(path).stem, tuple(found["broken"]), tuple(found["notes"]))


def _answer(path: str) -> dict[str, Any]:
    try:
        found = check_file(path)
    except (UserError, SpecError) as error:
        return {"refused": str(error)}
    except MemoryError:
        return {"broken": ["takes more memory than it may"], "notes": []}
    except BaseException as error:  # whatever a stranger's code does, sys.exit too
        return {"broken": [" ".join(f"ends with {type(error).__name__}: {error}".split())[:300]], "notes": []}
    return {"broken": found.broken, "notes": found.notes}


def _main(handle: int, most: int, path: str) -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    os.write(handle, json.dumps(_answer(path)).encode())
    os._exit(0)  # nothing a plug-in left behind is waited for


if __name__ == "__main__":
    _main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])

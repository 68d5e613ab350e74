"""Start, time, restart and stop the worker process of a third-party detector.

A plug-in is trusted code with the user's privileges. Its worker protects the other results against
mistakes (an exception, a crash, a hang, memory, output, an answer that cannot be used), not against
intent; see SECURITY.md.
"""

from __future__ import annotations

import atexit
import contextlib
import math
import os
import pickle
import re
import shutil
import signal
import site
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from simbench.detectors.compiled import cache_folder
from simbench.detectors.errors import AnswerError, ParameterError, UserError

SECONDS = 60.0  # per question
START = 60.0  # s for the worker to begin, and to import the plug-in
_LOOK = 0.1  # s between two looks at the clock
_GRACE = 5.0  # s for a worker to end by itself
BYTES = 2 << 30  # of memory
MESSAGE = 1 << 20  # bytes of a detector's answer
STRIKES = 3  # workers lost in one piece of work, after which the plug-in is asked no more there
_ESCAPES = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)|.)?", re.DOTALL)
_TEMPORARY = ("HOME", "USERPROFILE", "TMPDIR", "TEMP", "TMP", "MPLCONFIGDIR")
_CACHES = ("XDG_CACHE_HOME", "LOCALAPPDATA", "NUMBA_CACHE_DIR")


class PluginError(UserError):
    """What a plug-in did instead of answering."""


class Host:
    """The worker process of one plug-in.

    `source` is its file or published name; `describe(source)` imports it in the worker and returns
    what it says of itself; an answer may take `seconds`. A lost worker is replaced when it is asked
    again.
    """

    def __init__(
        self,
        describe: Callable | None,
        source: str,
        seconds: float = SECONDS,
    ) -> None:
        self.source = source
        self.seconds = seconds
        self.strikes = 0
        self._describe = describe
        self._process = None
        self._owner = 0
        self._until = math.inf  # when an answer is due
        self._lock = threading.RLock()
        atexit.register(self.close)

    def described(self) -> Any:
        """Return what the plug-in says of itself; PluginError where it cannot be imported."""
        self._start()
        return self._description

    def call(self, function: Callable, *arguments: Any, seconds: float = 0.0) -> Any:
        """Return what a module's function gives in the worker; PluginError where it gives nothing
        of use.
        """
        with self._lock:
            self._start()
            return self._ask((function, arguments), seconds or self.seconds)

    def close(self) -> str:
        """End the worker and what it started in its session; return how it ended."""
        process = self._process
        self._process = None
        if process is None or self._owner != os.getpid():
            return ""
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE)
        _kill(process)
        code = process.wait()
        process.stdout.close()
        shutil.rmtree(self._folder, ignore_errors=True)
        return f"signal {-code}" if code < 0 else f"exit status {code}"

    def _start(self) -> None:
        if self.strikes >= STRIKES:
            raise PluginError(
                f"asked no more, as its process was lost {STRIKES} times in this piece of work"
            )
        if (
            self._process is not None
            and self._owner == os.getpid()
            and self._process.poll() is None
        ):
            return
        self.close()
        self._owner = os.getpid()
        self._folder = tempfile.mkdtemp(prefix="simbench-plugin-")
        kernels = cache_folder() / "plugins" / f"detector-{Path(self.source).stem}"
        paths = [
            str(Path(str(sys.modules["simbench"].__file__)).resolve().parents[1]),
            *os.environ.get("PYTHONPATH", "").split(os.pathsep),
        ]
        variables = {
            **dict.fromkeys(_TEMPORARY, self._folder),
            **dict.fromkeys(_CACHES, str(kernels)),
            "PYTHONPATH": os.pathsep.join(os.path.abspath(p) for p in paths if p),
            "PYTHONUSERBASE": site.getuserbase(),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "simbench.detectors.plugins.process",
                str(BYTES),
                str(MESSAGE),
                self._folder,
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            cwd=self._folder,
            env=os.environ | variables,
        )
        threading.Thread(target=self._watch, args=(self._process,), daemon=True).start()
        _tell_unlimited()
        try:
            self._description = (
                self._ask((self._describe, (self.source,)), max(START, self.seconds))
                if self._describe
                else None
            )
        except UserError:
            self.close()
            raise

    def _ask(self, question: tuple, seconds: float) -> Any:
        process = self._process
        asked = pickle.dumps(question)
        began = time.monotonic()
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        self._until = began + seconds
        try:
            pickle.dump(asked, process.stdin)
            process.stdin.flush()
            error, answer = pickle.loads(pickle.load(process.stdout))
        except BaseException as lost:  # after Ctrl-C too, no answer may wait for the next question
            late = time.monotonic() - began >= seconds
            gone = isinstance(lost, (EOFError, OSError))
            if not gone:
                _kill(process)
            ended = self.close()
            if not isinstance(lost, Exception):
                raise
            self.strikes += 1
            fault = f"took longer than {seconds:g} s" if late else f"ended its process ({ended})"
            raise PluginError(
                fault if gone else "answered with something that cannot be understood"
            ) from None
        finally:
            self._until = math.inf
        if error:
            kinds = {"failed": PluginError, "refused": ParameterError, "form": AnswerError}
            raise kinds[error](cleaned(answer))
        return answer

    def _watch(self, process: subprocess.Popen) -> None:
        # a thread that looks, as not every platform waits for a pipe with a time limit
        while process.poll() is None:
            if time.monotonic() > self._until:
                _kill(process)
            time.sleep(_LOOK)


def _kill(process: subprocess.Popen) -> None:
    with contextlib.suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


def cleaned(text: str) -> str:
    """Return a text as one line that every terminal, table and page can show."""
    if text.isprintable():
        return text
    shown = "".join(
        c if c.isprintable() else " " if c.isspace() else "?" for c in _ESCAPES.sub("", text)
    )
    return " ".join(shown.split())


@cache
def _tell_unlimited() -> None:
    try:
        import resource  # noqa: F401
    except ImportError:
        print("plug-ins have no limit on memory here: this platform has none", file=sys.stderr)

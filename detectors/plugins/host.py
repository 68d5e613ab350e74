"""The one host of third-party plug-ins: a process of their own that answers questions in plain values, within limits.

What a plug-in raises, prints, changes, starts or never finishes touches nothing else: it becomes a sentence about itself.
"""

from __future__ import annotations

import atexit
import base64
import contextlib
import json
import os
import pickle
import queue
import re
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from detectors.errors import UserError

SECONDS = 60.0  # per question
START = 60.0  # s for its process to begin, and to import the plug-in for the first time
_GRACE = 5.0  # s within which all that it started is ended
BYTES = 2 << 30  # of memory
MESSAGE = 1 << 20  # bytes of an answer
STRIKES = 3  # processes lost in one piece of work, after which the plug-in is asked no more there
_NEVER_TOLD = ("PWD", "OLDPWD", "_", "PYTEST_CURRENT_TEST")  # environment that says where the run works
_LONGEST = 300  # characters of an error's text
_ESCAPES = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)|.)?", re.DOTALL)


class PluginError(UserError):
    """What a plug-in did instead of answering; `refusal` is the sentence of an error that a user can put right."""

    def __init__(self, said: str, refusal: str | None = None) -> None:
        super().__init__(said)
        self.refusal = refusal


class Host:
    """A process that imports plug-ins of others and answers questions, with a limit on time and, where there is one, on memory.

    `load` is a module's function that imports the plug-in there and returns, in plain values, what it says of itself; an answer
    may take `seconds`; it may write to `folders` beside one of its own; a `detector` may import nothing that knows a
    benchmark's truth.
    """

    def __init__(self, load: Callable | None, *arguments: Any, seconds: float = SECONDS, folders=(), detector=False) -> None:
        self.seconds, self.strikes = seconds, 0
        self.refused: dict[str, None] = {}  # what it tried to do and may not
        self._load = (load, arguments)
        self._rules = {"folders": [str(f) for f in folders], "detector": detector}
        self._process: subprocess.Popen | None = None
        self._said, self._fresh = None, True
        self._owner = os.getpid()
        atexit.register(self.close)

    @property
    def pid(self) -> int | None:
        """Number of the process, where one was started."""
        return None if self._process is None else self._process.pid

    def described(self) -> Any:
        """Return what the plug-in says of itself; PluginError where it cannot be imported."""
        self._begin()
        return self._said

    def fresh(self) -> bool:
        """Return whether nothing has been asked of its process yet, and start it if need be; True once per process."""
        self._begin()
        before, self._fresh = self._fresh, False
        return before

    def call(self, function: Callable, *arguments: Any, seconds=0.0, most: int = MESSAGE, fork=False) -> Any:
        """Return what a module's function gives there, in tables, lists, words, numbers and arrays; PluginError for nothing.

        `most` is the size of an answer in bytes; `fork` asks a copy of the process, which forgets the question.
        """
        self._begin()
        question = (pickle.dumps((function, arguments)), most, fork)
        return self._ask(question, seconds or self.seconds, most)

    def close(self) -> str:
        """End the process and all that it started; return how it ended."""
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():
            return "no exit status"
        process.terminate()
        self._questions.put(None)
        last: dict[str, Any] = {}
        with contextlib.suppress(queue.Empty, ValueError, RecursionError, subprocess.TimeoutExpired):
            while (said := self._answers.get(timeout=_GRACE)) is not None:
                last = json.loads(said)
                self._questions.put(None)  # read on: nothing more comes, which is how an end is seen
            process.wait(_GRACE)
        process.kill()
        code = process.wait()
        if last.get("left"):
            print(f"a plug-in left {last['left']} processes behind, which were ended", file=sys.stderr)
        return cleaned(last.get("ended")) or (f"signal {-code}" if code < 0 else f"exit status {code}")

    def _begin(self) -> None:
        if self.strikes >= STRIKES:
            raise PluginError(f"asked no more, as its process was lost {STRIKES} times in this piece of work")
        if self._process is not None and self._owner == os.getpid():
            return
        home = str(Path(__file__).resolve().parents[2])
        paths = [home, *(os.path.abspath(p) for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p)]
        known = {key: value for key, value in os.environ.items() if key not in _NEVER_TOLD}
        known |= {"PYTHONPATH": os.pathsep.join(paths), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._process = process = subprocess.Popen(
            [sys.executable, "-m", "detectors.plugins.process"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, start_new_session=True, env=known, bufsize=0,
        )  # fmt: skip
        self._owner, self._fresh = os.getpid(), True
        self._questions, self._answers = queue.SimpleQueue(), queue.SimpleQueue()
        # a thread that alone touches the pipes: not every platform waits for one with a time limit
        talk = (process.stdin, process.stdout, self._questions, self._answers)
        threading.Thread(target=_talk, args=talk, daemon=True).start()
        try:
            for lacking in self._ask({**self._rules, "bytes": BYTES}, START):
                _tell(lacking)
            self._said = self._ask((pickle.dumps(self._load), MESSAGE, False), START) if self._load[0] else None
        except PluginError:
            self.close()
            raise

    def _ask(self, question: Any, seconds: float, most: int = MESSAGE) -> Any:
        self._questions.put((pickle.dumps(question), most))
        try:
            said = self._answers.get(timeout=seconds)
            answer = {"ended": ""} if said is None else json.loads(said)
            if not isinstance(answer, dict):
                raise ValueError
            if "ended" in answer:
                self._answers.put(said)
                raise PluginError(f"ended its process ({self._lose()})")
            answer = cleaned(answer)
            self.refused |= dict.fromkeys(map(str, answer.get("refused", ())))
            if "error" in answer:
                raise PluginError(str(answer["error"])[:_LONGEST], answer.get("refusal"))
            return _arrays(answer.get("answer"))
        except queue.Empty:
            self._lose()
            raise PluginError(f"took longer than {seconds:g} s") from None
        except (ValueError, TypeError, RecursionError):
            self._lose()
            raise PluginError("answered with something that cannot be understood") from None

    def _lose(self) -> str:
        self.strikes += 1
        return self.close()


def cleaned(value: Any) -> Any:
    """Return plain values whose texts are one line each that every terminal, table and page can show."""
    if isinstance(value, str):
        if value.isprintable():
            return value
        shown = "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in _ESCAPES.sub("", value))
        return " ".join(shown.split())
    if isinstance(value, dict):
        return {cleaned(k): cleaned(v) for k, v in value.items()}
    return [cleaned(v) for v in value] if isinstance(value, list) else value


def _arrays(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) == {"float64"}:
            return np.frombuffer(base64.b64decode(value["float64"]), dtype="<f8").astype(float)
        return {k: _arrays(v) for k, v in value.items()}
    return [_arrays(v) for v in value] if isinstance(value, list) else value


def _talk(to: IO[bytes], back: IO[bytes], questions: queue.SimpleQueue, answers: queue.SimpleQueue) -> None:
    """Hand over questions and take answers, each behind its size in 8 bytes, until there is None of either."""
    most = MESSAGE
    with to, back:
        while True:
            asked = questions.get()
            if asked is not None:
                content, most = asked
                with contextlib.suppress(OSError):  # the process is gone: what it said last is still to be read
                    _put(to, content)
            size = _taken(back, 8)
            length = struct.unpack("<Q", size)[0] if size else 0
            if size is not None and length > most:
                answers.put(b"")
                return
            answers.put(None if size is None else _taken(back, length))
            if size is None:
                return


def _put(to: IO[bytes], content: bytes) -> None:
    left = memoryview(struct.pack("<Q", len(content)) + content)
    while left:
        left = left[to.write(left) :]


def _taken(back: IO[bytes], size: int) -> bytes | None:
    """Return that many bytes, or None where the other end is closed."""
    parts = []
    while size:
        part = back.read(min(size, 1 << 16))
        if not part:
            return None
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


@cache
def _tell(sentence: str) -> None:
    print(sentence, file=sys.stderr)

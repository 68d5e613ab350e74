"""Guests: plug-ins of strangers, each in a process of its own, with a limit on time and memory.

What a guest raises, prints, changes, or never finishes touches no other verdict: it becomes a reason of its own.
"""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import json
import math
import numbers
import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

from detectors.errors import ParameterError, UserError
from detectors.method import Method, Threshold
from detectors.prepared import Prepared
from detectors.record import PROCESSES
from detectors.verdict import VERDICTS, Verdict

SECONDS = 60.0  # per record
START = 60.0  # s for its process to begin, and to import the plug-in for the first time
BYTES = 2 << 30  # of memory
MESSAGE = 1 << 20  # bytes of an answer
PIPE = 1 << 20  # bytes of a question on its way
STRIKES = 3  # processes lost in one piece of work, after which the plug-in is asked no more there
WORDS = {"title": str, "source": str, "role": str, "budget": str}
NUMBERS = {"min_samples": int, "min_periods": float}


class GuestError(UserError):
    """What a guest did instead of answering."""


class Host:
    """A process that runs code of strangers and answers questions, with a limit on time and memory.

    Parameters
    ----------
    words : list of str
        The module to run, see `detectors.host_process.serve`, and its arguments behind the pipes and the parent.
    seconds : float
        Time it may take for an answer, where no other is said.
    most : int
        Bytes of an answer.
    """

    def __init__(self, words: list[str], seconds: float = SECONDS, most: int = MESSAGE) -> None:
        self.seconds, self.strikes, self.most = seconds, 0, most
        self._words = words
        self._process: subprocess.Popen | None = None
        self._to = self._back = -1
        self._owner = os.getpid()
        atexit.register(self.close)

    @property
    def pid(self) -> int | None:
        """Number of the process, where one was started."""
        return None if self._process is None else self._process.pid

    def close(self) -> None:
        """End the process and all it started."""
        process, self._process = self._process, None
        if process is None or self._owner != os.getpid():
            return
        for handle in (self._to, self._back):
            with contextlib.suppress(OSError):
                os.close(handle)
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def refuse_lost(self) -> None:
        """Raise GuestError when the process was lost too often to be asked again."""
        if self.strikes >= STRIKES:
            raise GuestError(f"asked no more, as its process was lost {STRIKES} times in this piece of work")

    def _start(self) -> None:
        read_mine, self._to = os.pipe()
        self._back, write_mine = os.pipe()
        module, *more = self._words
        words = [sys.executable, "-m", module, *map(str, (read_mine, write_mine, os.getpid())), *more]
        home = str(Path(__file__).resolve().parents[2])
        paths = os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])
        try:
            self._process = subprocess.Popen(
                words, pass_fds=(read_mine, write_mine), start_new_session=True, stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
        finally:
            os.close(read_mine)
            os.close(write_mine)
        for handle in (self._to, self._back):
            os.set_blocking(handle, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with contextlib.suppress(OSError):  # a question in one piece: both processes are woken once
                fcntl.fcntl(self._to, fcntl.F_SETPIPE_SZ, PIPE)
        self._owner = os.getpid()
        self._read(time.monotonic() + START)

    def ask(self, message: dict[str, Any], seconds: float, times: int = 1) -> Any:
        """Return the answer to a question that may take a time, or several such; GuestError where none comes."""
        content = pickle.dumps({**message, "seconds": seconds * times, "bytes": BYTES})
        try:
            if self._process is None or self._owner != os.getpid():
                self._process = None
                self._start()
            until = time.monotonic() + seconds * times
            self._write(struct.pack("<Q", len(content)) + content, until)
            answer = json.loads(self._read(until))
        except TimeoutError:
            self._lose()
            raise GuestError(f"took longer than {seconds:g} s") from None
        except (EOFError, OSError):
            raise GuestError(f"ended its process ({self._lose()})") from None
        except (ValueError, RecursionError):
            self._lose()
            raise GuestError("answered with something that cannot be understood") from None
        if not isinstance(answer, dict) or "error" in answer:
            raise GuestError(str(answer["error"])[:300] if isinstance(answer, dict) else "answered with nothing")
        return answer.get("answer")

    def _lose(self) -> str:
        self.strikes += 1
        process = self._process
        if process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
        code = None if process is None else process.returncode
        self.close()
        return "no exit status" if code is None else f"signal {-code}" if code < 0 else f"exit status {code}"

    def _write(self, content: bytes, until: float) -> None:
        left = memoryview(content)
        while left:
            try:
                left = left[os.write(self._to, left) :]
            except BlockingIOError:
                self._wait(self._to, select.POLLOUT, until)

    def _read(self, until: float) -> bytes:
        """Return one answer: its size, 8 bytes, then what it says. Usually one look at the pipe finds all of it."""
        parts, size = b"", 8
        while len(parts) < size:
            self._wait(self._back, select.POLLIN, until)
            part = os.read(self._back, 1 << 16)
            if not part:
                raise EOFError
            parts += part
            if size == 8 and len(parts) >= 8:
                size += struct.unpack("<Q", parts[:8])[0]
                if size > self.most:
                    raise ValueError(f"an answer of {size} bytes")
        return parts[8:]

    @staticmethod
    def _wait(handle: int, event: int, until: float) -> None:
        poll = select.poll()
        poll.register(handle, event)
        if not poll.poll(max(0.0, until - time.monotonic()) * 1e3):
            raise TimeoutError


class Guest(Host):
    """One detector in a process of its own.

    Parameters
    ----------
    source : Path or str
        A file, or the name under which another distribution publishes it; it is imported by that process alone.
    seconds : float
        Time it may take for a record.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "mine.py"
    >>> _ = file.write_text("import sys\\nsys.exit(3)\\n")
    >>> Guest(file).describe()
    Traceback (most recent call last):
    detectors.plugins.host.GuestError: SystemExit: 3
    """

    def __init__(self, source: Path | str, seconds: float = SECONDS) -> None:
        super().__init__(["detectors.host_process", str(source)], seconds)

    def describe(self) -> Method:
        """Return what the plug-in says of itself.

        Raises
        ------
        GuestError
            When it cannot be imported, or says nothing that can be understood.
        """
        return _method(self.ask({"do": "describe"}, START))

    def stub(self) -> ModuleType:
        """Return what stands for the plug-in outside its own process: its description of itself; GuestError as `describe`."""
        method = self.describe()
        stub = ModuleType("guest", method.title)
        stub.__dict__.update(METHOD=method, detect=None, __file__=None)
        return stub

    def judge(self, name: str, prepared: Prepared, modes: tuple[bool, ...], thresholds: dict[str, float]) -> list[Verdict]:
        """Return the plug-in's verdict on a record for every mode (raw or not), under the name it was asked by.

        Raises
        ------
        GuestError
            When it raised, took too long, took too much memory, ended its process, or answered with no verdict.
        """
        self.refuse_lost()
        known = {name: value for name in ("oscillation", "flags") if (value := prepared.__dict__.get(name)) is not None}
        about = {"record": prepared.record, "front_end": prepared.front_end, "part": prepared.part, "known": known}
        asked = {"do": "judge", **about, "modes": modes, "thresholds": thresholds}
        answer = self.ask(asked, self.seconds, len(modes))
        if not isinstance(answer, list) or len(answer) != len(modes):
            raise GuestError("answered with something that is no verdict")
        return [verdict_of(name, one) for one in answer]


def number_of(value: Any, what: str) -> float:
    """Return what a guest gave as a float, or raise GuestError."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise GuestError(f"gives {what} = {value!r}, which is no number")
    return float(value)


def verdict_of(name: str, said: Any) -> Verdict:
    """Rebuild a verdict from plain values, each checked; nothing of the guest's own classes crosses over."""
    word = said.get("verdict") if isinstance(said, dict) else said
    if not isinstance(said, dict) or not isinstance(word, str) or word not in VERDICTS:
        raise GuestError(f"answers {word!r}; allowed: {', '.join(VERDICTS)}")
    if not isinstance(said.get("reason"), str) or not said["reason"].strip():
        raise GuestError("gives no reason")
    if said.get("applicable") not in (True, False, None):
        raise GuestError(f"gives applicable = {said['applicable']!r}; true, false or null is needed")
    indices = said.get("indices")
    if not isinstance(indices, dict):
        raise GuestError("gives indices that are no table of numbers")
    levels = {}
    for key in ("S", "J"):
        level = said.get(key)
        ends = level if isinstance(level, list) else [level]
        if level is not None and (len(ends) not in (1, 2) or not all(math.isfinite(number_of(v, key)) for v in ends)):
            raise GuestError(f"gives {key} = {level!r}; a number, [lo, hi] or null is needed")
        levels[key] = None if level is None else tuple(map(float, ends)) if isinstance(level, list) else float(level)
    return Verdict(
        name, said["verdict"], score=number_of(said.get("score"), "score"), applicable=said.get("applicable"),
        indices={str(k): number_of(v, str(k)) for k, v in indices.items()}, S_unit=str(said.get("S_unit", "% of travel")),
        reason=said["reason"], **levels,
    )  # fmt: skip


def _method(said: Any) -> Method:
    """Rebuild a plug-in's description of itself from plain values, each checked."""
    if not isinstance(said, dict):
        raise GuestError("METHOD is no detectors.method.Method")
    fields: dict[str, Any] = {}
    for key, kind in WORDS.items():
        if not isinstance(said.get(key), kind) or not said[key]:
            raise GuestError(f"METHOD.{key} = {said.get(key)!r}; words are needed")
        fields[key] = said[key]
    fields |= {key: kind(number_of(said.get(key), f"METHOD.{key}")) for key, kind in NUMBERS.items()}
    for key in ("needs_mv", "front_end"):
        if not isinstance(said.get(key), bool):
            raise GuestError(f"METHOD.{key} = {said.get(key)!r}; true or false is needed")
        fields[key] = said[key]
    process = said.get("process")
    if not isinstance(process, list) or not process or any(p not in PROCESSES for p in process):
        raise GuestError(f"METHOD.process = {process!r}; known: {', '.join(PROCESSES)}")
    flags = said.get("cannot_cope")
    if not isinstance(flags, list) or not all(isinstance(f, str) for f in flags):
        raise GuestError(f"METHOD.cannot_cope = {flags!r}; names of flags are needed")
    rules = said.get("thresholds")
    if not isinstance(rules, dict) or not all(isinstance(r, dict) for r in rules.values()):
        raise GuestError("METHOD.thresholds is no table of detectors.method.Threshold")
    thresholds = {
        str(key): Threshold(
            *(number_of(r.get("default"), f"{key}.default"), str(r.get("unit"))),
            *(number_of(r.get(end), f"{key}.{end}") for end in ("low", "high")), str(r.get("source")), str(r.get("says")),
        )
        for key, r in rules.items()
    }  # fmt: skip
    return Method(**fields, process=tuple(process), cannot_cope=tuple(flags), thresholds=thresholds)


def refuse_name(path: Path, kind: str, taken: bool) -> None:
    """Raise ParameterError when a file's stem cannot be the id of a plug-in, or is one that means something already."""
    name = path.stem
    if not name.isidentifier() or name != name.lower():
        raise ParameterError(f"{kind} file {path}: {name!r} is no id; small letters, digits and _ are needed; rename the file")
    if taken:
        raise ParameterError(f"{kind} file {path}: the name {name!r} is taken; another is needed: rename the file")

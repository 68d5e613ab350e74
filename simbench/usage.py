"""Handle the errors of every command line: print one sentence on stderr and return an exit code,
without a traceback.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TextIO

from simbench.detectors.errors import RecordError, UserError, masked, printable
from simbench.detectors.faults import sentence_of
from simbench.scenarios.errors import SpecError

STOPPED = b"stopped by SIGTERM; no output is half-written\n"
TERMINATED = 128 + signal.SIGTERM  # exit code, as a shell gives it
UNREAD = 141  # that of SIGPIPE, which not all systems have: the reader of the output is gone
_WHOLE = 1e15  # up to which a float holds every whole number
_LONGEST = 950  # characters of a sentence; a longer one is cut in its middle


def exit_code(work: Callable[[], int | None], command: Sequence[str] = ()) -> int:
    """Run a command and return its exit code; a refusal that options would help ends with the
    command that has them.
    """
    _open_closed_streams()
    code = _exit_code_of(work, command)
    # what is printed while the interpreter ends is nobody's answer
    if code == 0 and isinstance(sys.stdout, _ClosedOutput) and sys.stdout.lost:
        return complain(
            "stdout is closed, so what this command prints is lost; open it, or write it to a file"
            " with >"
        )
    return code


def _exit_code_of(work: Callable[[], int | None], command: Sequence[str]) -> int:
    """Run a command and return its exit code, whatever it raises."""
    # What is printed may hold the name of a file
    if hasattr(sys.stdout, "reconfigure"):  # the name of a file may be no text
        sys.stdout.reconfigure(errors="backslashreplace")

    # the command itself, then what it may end with: a refusal, a lost reader, a signal, a fault
    try:
        with _end_on_sigterm():
            code = int(work() or 0)
            sys.stdout.flush()  # a lost reader shows here, not while the interpreter ends
            return code
    except (UserError, SpecError) as error:
        cure = getattr(error, "cure", "")
        return complain(
            f"{error.sentence}; try: {add_options(command, cure)}"
            if cure and command
            else str(error)
        )
    except BrokenPipeError:
        _drop_stream(sys.stdout)
        return UNREAD
    except KeyboardInterrupt as error:
        print(masked(error) or "interrupted", file=sys.stderr)
        return 130
    except SystemExit as stop:
        # click ends with 1 where its reader is gone, argparse has printed its help or its complaint
        if isinstance(stop.__context__, BrokenPipeError):
            return UNREAD
        if stop.code in (None, 0, 1, TERMINATED):
            return int(stop.code or 0)
        return 2
    except Exception as error:
        return complain(sentence_of(error, command))


def _open_closed_streams() -> None:
    """Give standard streams that a daemon has closed to nobody: else the next file that is opened
    has the number of one, and what is written to that ends up in the file.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None and number:
            setattr(sys, name, _ClosedOutput(open(number, "wb", closefd=False), "utf-8"))  # noqa: SIM115


class _ClosedOutput(io.TextIOWrapper):
    """A stream that nobody reads, which knows whether anything was written to it."""

    lost = False

    def write(self, text: str, /) -> int:
        self.lost = self.lost or bool(text.strip())
        return super().write(text)


@contextlib.contextmanager
def _end_on_sigterm() -> Iterator[None]:
    """Let SIGTERM end a command with a word, and with what cleans up after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(*_: object) -> None:
        os.write(2, STOPPED)  # print may have been what was interrupted
        raise SystemExit(TERMINATED)

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


def add_options(command: Sequence[str], cure: str) -> str:
    """Return a command with further options, in place of those with the same names."""
    # The option with its new values
    option, *values = shlex.split(cure)
    words = []
    old = []
    at = 0

    # The command without it; old values are kept for columns
    while at < len(command):
        name, equals, value = command[at].partition("=")
        if name != option:
            words.append(command[at])
            at += 1
            continue
        if equals:
            old += [value]
            at += 1
        else:
            old += command[at + 1 : at + 1 + len(values)]
            at += 1 + len(values)

    # Columns add up
    if option == "--columns":
        both = (column_pairs(old) or {}) | (column_pairs(values) or {})
        values = [",".join(f"{role}={name}" for role, name in both.items())]
    return shlex.join(words + [option] + values)


def column_pairs(texts: Sequence[str] | None) -> dict[str, str] | None:
    """Return the columns that a command line names."""
    # Several options, several pairs in each
    pairs: dict[str, str] = {}
    parts = []
    for text in texts or []:
        parts += re.split(r",(?=\s*\w+\s*=)", text)

    # Each pair names a role once
    for part in parts:
        role, _, name = (word.strip() for word in part.partition("="))
        if not role or not name:
            raise RecordError(f"--columns {part!r}: ROLE=NAME is needed, like op=FIC101.OUT")
        if role in pairs:
            raise RecordError(
                f"--columns {part!r}: {role} is {pairs[role]!r} already; one is allowed"
            )
        pairs[role] = name
    return pairs or None


def setting_words(settings: Mapping[str, Any]) -> list[str]:
    """Return settings as words of a command line: --set, or --axis for several values.

    >>> setting_words({"noise.std": 2.0, "S_over_2J": [0.5, 1.0]})
    ['--set', 'noise.std=2', '--axis', 'S_over_2J=0.5,1']
    """
    words = []
    for key, value in settings.items():
        several = isinstance(value, (list, tuple))
        values = map(plain_number, value if several else [value])
        words += ["--axis" if several else "--set", f"{key}={','.join(values)}"]
    return words


def plain_number(value: object) -> str:
    """Return a value as people write it: a whole number without a point."""
    whole = isinstance(value, float) and value.is_integer() and abs(value) < _WHOLE
    return str(int(value) if whole else value)


def complain(sentence: str) -> int:
    """Print one sentence to stderr and return the exit code of wrong usage, 2."""
    text = printable(masked(" ".join(sentence.split())))
    if len(text) <= _LONGEST:
        short = text
    else:
        short = f"{text[: _LONGEST - 300]} [...] {text[-290:]}"
    try:
        print(f"error: {short}", file=sys.stderr, flush=True)
    except OSError:  # nobody reads it, or its disk is full; the exit code still tells
        _drop_stream(sys.stderr)
    return 2


def _drop_stream(stream: TextIO) -> None:
    """Send a stream to nobody: what it still holds would raise once more when the interpreter
    ends.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())

"""Errors that a user can cause.

Each message is one sentence: what, where, the value, what is allowed, and the nearest valid name.
"""

from __future__ import annotations

import contextlib
import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches


class UserError(Exception):
    """Base of every error that a command line answers with one sentence and exit code 2."""


@dataclass(frozen=True)
class Refusal:
    """Why there is no answer for one of several things, in a sentence; the others are answered."""

    reason: str


class RecordError(UserError, ValueError):
    """A loop record that cannot be read or judged at all.

    Parameters
    ----------
    sentence : str
        What, where, the value, what is needed.
    cure : str
        Options with which the same command works, as they are typed.
    """

    def __init__(self, sentence: object = "", cure: str = "") -> None:
        super().__init__(f"{sentence}; add {cure}" if cure else sentence)
        self.sentence = str(sentence)
        self.cure = cure


class ParameterError(UserError, ValueError):
    """A parameter outside what its owner allows."""


class AnswerError(ParameterError):
    """A detector that cannot be called with a record, or whose answer is no verdict; the sentence
    shows the right form.
    """


class UnknownName(UserError, LookupError):
    """A name that no plug-in, grid or figure answers to.

    Parameters
    ----------
    kind : str
        What was looked for: "detector", "grid", ...
    name : str
        What the user wrote.
    known : iterable of str
        What would have been understood.
    where : str
        Where it was written.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], where: str = "") -> None:
        if where:
            place = f" in {where}"
        else:
            place = ""
        super().__init__(f"unknown {kind} {name!r}{place}: {nearest(name, known)}")


@contextlib.contextmanager
def naming(place: object) -> Iterator[None]:
    """Prefix the message of a user error with the file or other place it occurred in, unless the
    message names it already.

    >>> with naming("loop.toml"):
    ...     raise ParameterError("S = -1; it must be >= 0")
    Traceback (most recent call last):
    simbench.detectors.errors.ParameterError: loop.toml: S = -1; it must be >= 0
    """
    try:
        yield
    except UserError as error:
        if str(place) in str(error):
            raise
        raise ParameterError(f"{place}: {error}") from error


_FEW = 12  # known names that a sentence lists as a whole

_SECRETS = re.compile(
    r"""(?P<before>(?<=[\w+.-]):/+)[^/\s"']*@|(?<![^\s"'])[^\s/"'@:]+:[^\s/"'@]*@"""
    r"""|(?P<key>[?&](?=[\w-]*(?:pass|secret|token|key|sig|credential))[\w-]+=)[^&\s"']+""",
    re.IGNORECASE,
)


def masked(text: object) -> str:
    """Return a text with user, password and keys of every URL in it replaced by `***`."""
    return _SECRETS.sub(
        lambda m: f"{m['key']}***" if m["key"] else f"{m['before'] or ''}***@", str(text)
    )


def printable(text: object, kept: str = "") -> str:
    r"""Return a text with what would move a terminal's cursor, turn its direction or be no Unicode
    written as an escape; `kept` are characters that stay.

    >>> printable("FIC\x1b[31m\u202e")
    'FIC\\x1b[31m\\u202e'
    """
    return "".join(
        c if c.isprintable() or c in kept or unicodedata.category(c) == "Zs" else ascii(c)[1:-1]
        for c in str(text)
    )


def nearest(name: str, known: Iterable[str]) -> str:
    """Say which known names come closest to a wrong one; of many at most three are named.

    >>> nearest("horhc", ["horch", "he"])
    "did you mean 'horch'?"
    >>> nearest("x", map(str, range(5000)))
    'the nearest of 5000 known: 997, 998, 999'
    """
    names = sorted(known)
    plain = {}
    for n in reversed(names):
        plain[n.lower()] = n
    close = [plain[c] for c in get_close_matches(name.lower(), plain, n=3, cutoff=0.55)]
    if close:
        return "did you mean " + " or ".join(repr(c) for c in close) + "?"
    if len(names) <= _FEW:
        return "known: " + ", ".join(names)
    likest = get_close_matches(name.lower(), plain, n=3, cutoff=0.0)
    return f"the nearest of {len(names)} known: " + ", ".join(sorted(plain[c] for c in likest))

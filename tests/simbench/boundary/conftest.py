"""Running the command line on bad input: one sentence, one exit code, nothing else."""

from __future__ import annotations

import contextlib
import io
import json
import re
import resource
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from simbench.bench.execute import run as run_module
from simbench.cli import main

# a word of the program's inside where a sentence about the input is due
LEAKS = re.compile(
    r"Traceback|fault of the program|object has no"
    r" attribute|pydantic|NoneType|errors\.|site-packages"
)


# what would do instead: a range, a list, the nearest name, the kind of thing that is needed
ALLOWED = re.compile(
    r"needed|needs|known|allowed|did you mean|must be|should be|at least|at most|\d to"
    r" -?\d|either|ends in|asked for with"
    r"|columns are",
    re.I,
)
# a file, folder, option or argument that is not there or cannot be used: its name is all there is
# to say
ABSENT = re.compile(
    r"does not exist|no such file|cannot be (made|written)|holds no|exists already|is read by this"
    r" command|no loop record found"
    r"|no records/|has neither|^error: (missing |option .* requires|a verb is missing|no such"
    r" option)",
    re.I,
)
TOKEN = re.compile(r'"[^"]*"|[-+]?[\w.]+(?:[-+:.]\w+)*')
SECONDS, MEMORY = 60.0, 2 << 20  # of CPU; KiB


def sampled(cases: Iterable, every: int = 1, always: Iterable = ()) -> list:
    """Every n-th case, and those named, in each run of the tests; all others before a release."""
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=() if case in always or (every and not i % every) else pytest.mark.slow,
        )
        for i, case in enumerate(cases)
    ]


def new_tokens(old: str, new: str) -> list[str]:
    """What a change of TOML brought in: the values, or the misspelt names, that a sentence about
    it should quote.
    """
    known = TOKEN.findall(old)
    return [token for token in TOKEN.findall(new) if token not in known]


def quotes(sentence: str, value: str) -> bool:
    """Whether a sentence quotes a value as it was given, or a number equal to it."""
    text = value.strip('"')
    last = text.rpartition(".")[2]
    if text.count(".") == 1 and last and not last[0].isdigit():  # of a dotted key
        text = last
    if text.lower()[:30] in sentence.lower():
        return bool(text) or any(empty in sentence for empty in ("''", '""', "empty", "nothing"))
    try:
        number = float(text)
        numbers = map(float, re.findall(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", sentence))
        return f"{number:.0f}"[:30] in sentence or number in numbers
    except (ValueError, OverflowError):
        return False


@contextlib.contextmanager
def bounded() -> Iterator[None]:
    """Whatever is asked takes at most 60 s of CPU, that of processes it started and ended included,
    and 2 GiB.
    """
    # the highest memory counts anew from here on, where the system can do that
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    seconds, memory = _seconds(), _memory()
    yield
    assert _seconds() - seconds <= SECONDS
    assert _memory() - memory <= MEMORY


def _seconds() -> float:
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(u.ru_utime + u.ru_stime for u in used)


def _memory() -> int:
    try:
        return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1])
    except (OSError, TypeError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def check_sentence(sentence: str, values: Iterable[str] | None = None) -> None:
    """Check that a sentence quotes what was wrong and names what is allowed; about what is absent
    it need not.
    """
    if not ABSENT.search(sentence):
        assert all(quotes(sentence, value) for value in values or ()), (values, sentence)
        assert ALLOWED.search(sentence), sentence


def run_verb(words: str | list) -> tuple[int, str, str]:
    """Run a command; return the exit code, and what was written to stdout and to stderr."""
    out, err = io.StringIO(), io.StringIO()
    words = words.split() if isinstance(words, str) else [str(word) for word in words]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    return code, out.getvalue(), err.getvalue()


def answer_to(words: str | list, code: int = 0) -> str:
    """Run a command that ends with this exit code; return what it wrote to stdout."""
    ended, answer, message = run_verb(words)
    assert ended == code, message
    return answer


def asked(words: str | list) -> tuple[int, str, str]:
    """Run a command with bounds: exit 0 or 1 with JSON, 2 with one sentence, 130 where it was
    stopped.
    """
    with bounded():
        code, answer, message = run_verb(words)
    assert code in (0, 1, 2, 130), (code, message)
    assert not LEAKS.search(message), message
    if code == 2:
        assert answer == ""
        assert message.startswith("error: "), message
        assert message.count("\n") == 1, message
    elif code < 2 and "--json" in words:
        json.loads(answer, parse_constant=no_constant)
    return code, answer, message


def refused(words: str | list, *parts: str, values: Iterable[str] | None = None) -> str:
    """Run a command that must be refused: exit 2, one sentence that holds the parts, nothing on
    stdout.

    `values`: what was wrong, which the sentence must quote, and say what is allowed as well.
    """
    code, answer, message = asked(words)
    assert code == 2, (code, message, answer[:300])
    assert len(message) < 1000, message[:2000]
    for part in parts:
        assert part.lower() in message.lower(), (part, message)
    check_sentence(message, values)
    return message


def no_constant(word: str) -> float:
    raise AssertionError(f"{word} is no JSON")


def names_in(folder: Path) -> list[str]:
    """Names in a folder, hidden ones too."""
    return sorted(p.name for p in folder.iterdir())


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """The folder in which the commands of a test run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def stopped(monkeypatch):
    """A run that is interrupted where its first simulation would begin."""

    def never(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(run_module, "compute_piece", never)

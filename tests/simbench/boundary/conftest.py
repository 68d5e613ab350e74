"""Running the command line on bad input: one sentence, one exit code, nothing else."""

from __future__ import annotations

import contextlib
import json
import re
import resource
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from simbench.cli import main

# a word of the program's own where a sentence about the input is due
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
COUNT: Counter[str] = Counter()


def tokens(text: str) -> list[str]:
    """Words and numbers of a piece of TOML."""
    return TOKEN.findall(text)


def new_tokens(old: str, new: str) -> list[str]:
    """What a change brought in: the values, or the misspelt names, that a sentence about it should
    quote.
    """
    known = tokens(old)
    return [t for t in tokens(new) if t not in known]


def quoted(sentence: str, value: str) -> bool:
    """Whether a sentence quotes a value as it was given, or a number equal to it."""
    text = value.strip('"')
    last = text.rpartition(".")[2]
    if text.count(".") == 1 and last and not last[0].isdigit():  # of a dotted key
        text = last
    if text.lower()[:30] in sentence.lower():
        return bool(text) or any(empty in sentence for empty in ("''", '""', "empty", "nothing"))
    try:
        if f"{float(text):.0f}"[:30] in sentence:
            return True
        return float(text) in [
            float(found) for found in re.findall(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", sentence)
        ]
    except (ValueError, OverflowError):
        return False


def pytest_terminal_summary(terminalreporter) -> None:
    """Say how many sentences were held against what was wrong; of one process, so with `-n 0`."""
    if COUNT["refused"]:
        terminalreporter.write_line(
            f"boundary: {COUNT['refused']} refused in one sentence that names its place;"
            f" {COUNT['allowed']} were held to say what is allowed, {COUNT['value']} of them to"
            f" quote the value; {COUNT['absent']} are about what is not there or cannot be used"
        )


SECONDS, MEMORY = 60.0, 2 << 20  # of CPU; KiB


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
        found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    except OSError:
        found = None
    return int(found[1]) if found else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def held(sentence: str, values: list[str] | None = None) -> None:
    """Hold a sentence to quote what was wrong, and to say what is allowed; about what is not there
    it need not.
    """
    COUNT["refused"] += 1
    if ABSENT.search(sentence):
        COUNT["absent"] += 1
    else:
        assert all(quoted(sentence, v) for v in values or ()), (values, sentence)
        assert ALLOWED.search(sentence), sentence
        COUNT["allowed"] += 1
        COUNT["value"] += bool(values)


@pytest.fixture
def refused(capsys) -> Callable[..., str]:
    """Run a command that must be refused: exit 2, one sentence that holds the words, nothing on
    stdout.

    `values`: what was wrong, which the sentence must quote, and beside it say what is allowed.
    """

    def run(arguments: list, *words: str, values: list[str] | None = None) -> str:
        with bounded():
            code = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        assert code == 2, (code, err, out[:300])
        assert out == ""
        assert err.startswith("error: "), err
        assert err.count("\n") == 1, err
        assert len(err) < 1000, err[:2000]
        assert not LEAKS.search(err), err
        for word in words:
            assert word.lower() in err.lower(), (word, err)
        held(err, values)
        return err

    return run


@pytest.fixture
def told(capsys) -> Callable[..., tuple[int, str]]:
    """Run a command that may go on or be refused: exit 0 or 1 with JSON, or 2 with one sentence."""

    def run(arguments: list) -> tuple[int, str]:
        with bounded():
            code = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        assert code in (0, 1, 2), (code, err)
        assert not LEAKS.search(err), err
        if code == 2:
            assert out == ""
            assert err.startswith("error: "), err
            assert err.count("\n") == 1, err
        elif "--json" in arguments:
            json.loads(out, parse_constant=no_constant)
        return code, err if code == 2 else out

    return run


def no_constant(word: str) -> float:
    raise AssertionError(f"{word} is no JSON")


def written(folder: Path) -> list[str]:
    """Names in a folder, hidden ones too."""
    return sorted(p.name for p in folder.iterdir())

"""Running the command line on bad input: one sentence, one exit code, nothing else."""

from __future__ import annotations

import contextlib
import json
import re
import resource
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from simbench.cli import main

# a word of the program's own where a sentence about the input is due
LEAKS = re.compile(r"Traceback|fault of the program|object has no attribute|pydantic|NoneType|errors\.|site-packages")


SECONDS, MEMORY = 60.0, 2 << 20  # of CPU; KiB


@contextlib.contextmanager
def bounded() -> Iterator[None]:
    """Whatever is asked takes at most 60 s of CPU, that of processes it started and ended included, and 2 GiB."""
    with contextlib.suppress(OSError):  # the highest memory counts anew from here on, where the system can do that
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


@pytest.fixture
def refused(capsys) -> Callable[..., str]:
    """Run a command that must be refused: exit 2, one sentence that holds the words, nothing on stdout."""

    def run(arguments: list, *words: str) -> str:
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

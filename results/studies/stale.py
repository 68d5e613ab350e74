"""Which results were printed before the code that they depend on was changed?"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import grimp

from simbench.detectors.errors import ParameterError

# modules that are found by name, alone or in a package, and who asks for them: no import says so
_LOADED_BY_NAME = {
    "simbench.gap": ("simbench.gap.diagnosis",),
    "simbench.detectors.plugins.registry": ("simbench.detectors.methods",),
    "simbench.loop.parameters": (
        "simbench.loop.valves",
        "simbench.loop.effects",
        "simbench.loop.plants",
        "simbench.loop.controllers",
    ),
    "simbench.gap.effects": ("simbench.gap.effects",),
}
# the module in which the work of a verb begins
_VERBS = {
    "run": "simbench.bench.execute.run",
    "score": "simbench.bench.score.scoring",
    "check": "simbench.bench.check.check",
    "gap": "simbench.gap.diagnosis",
    "figure": "simbench.figures",
    "detect": "simbench.verbs",
}
# Python knows these folders by another name than git
_FOLDERS = {"simbench/detectors/": "detectors/", "simbench/scenarios/": "scenarios/"}


@dataclass(frozen=True)
class LastRun:
    """At which commit a row of results/README.md was last run ("": not known), and the minutes that
    it took.
    """

    commit: str
    minutes: float


@dataclass(frozen=True)
class Printed:
    """When a result was printed, and how many of the files that it depends on changed since."""

    name: str
    date: str  # of the commit that printed it; "" where it was never committed
    files: int
    changed: int
    lines: int  # added and removed in these
    minutes: float | None = None  # that it takes to print it again, where it was once measured

    def __str__(self) -> str:
        """One line of a list."""
        if not self.date:
            return f"{self.name}: not committed"
        takes = "" if self.minutes is None else f"; takes {self.minutes:.1f} minutes"
        return (
            f"{self.name}: printed {self.date}; of {self.files} files of code {self.changed} have"
            f" changed since, by {self.lines} lines{takes}"
        )


def list_stale(
    root: Path, table: Mapping[str, Sequence[str]], runs: Mapping[str, LastRun]
) -> list[Printed]:
    """Return the rows of results/README.md whose code changed since they were printed, the most
    changed first, with the minutes that each takes.
    """
    if not (root / ".git").exists():
        raise ParameterError(
            f"{root} is no git checkout; its history is needed to say what is stale"
        )
    graph = grimp.build_graph("simbench", "results")
    rows = [
        _look_up(root, name, code_of(commands, graph), runs.get(name))
        for name, commands in table.items()
    ]
    return sorted((r for r in rows if r.changed or not r.date), key=lambda r: -r.lines)


def code_of(commands: Iterable[str], graph: grimp.ImportGraph) -> set[str]:
    """Return the files of code that commands depend on, as git names them."""
    modules: set[str] = set()
    for start in _started_by(commands):
        for module in (start, f"{start}.__main__"):
            if module in graph.modules:
                modules |= {module, *graph.find_upstream_modules(module)}
    for asker, packages in _LOADED_BY_NAME.items():
        if asker in modules:
            named = {m for p in packages for m in {p, *graph.find_descendants(p)}}
            modules |= named.union(*(graph.find_upstream_modules(m) for m in named))
    return {file for module in modules for file in _files_of(module)}


def _started_by(commands: Iterable[str]) -> Iterable[str]:
    """Yield the modules that commands start: a study, or the function of a verb."""
    for command in commands:
        yield from re.findall(r"python -m (\S+)", command)
        for verb in re.findall(r"simbench (\w+)", command):
            if verb in _VERBS:
                yield _VERBS[verb]
        if command.startswith("make "):
            yield "simbench.verbs"


def _files_of(module: str) -> tuple[str, str]:
    path = module.replace(".", "/")
    for known, kept in _FOLDERS.items():
        path = f"{kept}{path.removeprefix(known)}" if path.startswith(known) else path
    return f"{path}.py", f"{path}/__init__.py"


def _is_known(root: Path, commit: str) -> bool:
    """Whether a checkout has a commit: a shallow one lacks most."""
    words = ["git", "cat-file", "-e", f"{commit}^{{commit}}"]
    return subprocess.run(words, cwd=root, capture_output=True).returncode == 0


def _look_up(root: Path, name: str, code: set[str], run: LastRun | None = None) -> Printed:
    """Return when a row of results/README.md was printed, and what changed of its code since: since
    its last run where that is known, else since the commit that last changed its file.
    """

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True)
        return done.stdout

    place = str((root / "results" / name).resolve().relative_to(root.resolve()))
    since = [run.commit] if run is not None and _is_known(root, run.commit) else ["--", place]
    commit, _, date = git("log", "-1", "--format=%H %as", *since).strip().partition(" ")
    files = code & set(git("ls-files", "simbench", "detectors", "scenarios", "results").split())
    minutes = None if run is None else run.minutes
    if not commit:
        return Printed(name, "", len(files), 0, 0, minutes)
    counts = [line.split("\t") for line in git("diff", "--numstat", commit).splitlines()]
    changed = [int(a) + int(b) for a, b, file in counts if file in files]
    return Printed(name, date, len(files), len(changed), sum(changed), minutes)

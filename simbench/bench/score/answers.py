"""What every method of a run said, one row a method, and what the reference rows say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from simbench.bench.score.names import CONSTANTS, NO_WAVEFORM, ROLE_YARDSTICK, WITH_RHYTHM
from simbench.bench.score.no_waveform import is_told, no_waveform
from simbench.bench.store.reading import CODES, RunArrays
from simbench.bench.store.tables import CELL_S_OVER_2J
from simbench.scenarios.grid import packaged_grid
from simbench.scenarios.packaged import grid_names

# of a healthy loop the cell's place on the axis, so that false positives have one
_AXIS_OF_CELL = {"S_over_2J": CELL_S_OVER_2J}


# axis of dead time of each process
_RATIO_OF = {"foptd": "Td_over_T", "integrating": "Td_over_Ti"}
_MOSTLY = 0.5  # share of a run's loops within a grid's ranges from which the run is alike


class Answers(NamedTuple):
    """What one method said on all n scenarios of a run."""

    method: str
    role: str
    sees_mv: bool
    said: np.ndarray
    score: np.ndarray
    applies: np.ndarray
    failed: np.ndarray
    runtime: np.ndarray
    home: str = "no"
    # "published", "tuned" (here, to simulated loops), "learned" or "reference"; None: not stated
    division: str | None = "reference"
    name: str = ""  # with every threshold that is not the method's default
    answered: str = "package"  # who asked the method; "file" where its answers were joined
    own: bool = False  # a plug-in or a detector of whoever ran it


def answers_of(book: RunArrays) -> Iterator[Answers]:
    """Yield what every method of a run said, and two yardsticks that always say the same."""
    for i, method in enumerate(book.methods):
        about = book.manifest["methods"][method]
        answered = about.get("answered", "package")
        added = {method, f"own {method}"} & set(book.manifest.get("plugins", ()))
        foreign = bool(added) or answered != "package"
        applies = book.applicable[i] != 0
        yield Answers(
            method,
            about["role"],
            about["needs_mv"],
            book.verdict[i],
            book.score[i],
            applies,
            book.failed[i],
            book.runtime[i],
            home_of(method, book),
            None if foreign else about.get("division"),
            _full_name(method, about.get("changed", {})),
            answered,
            foreign,
        )
    nothing = np.zeros(book.ids.size)
    for name, word in CONSTANTS.items():
        said = np.full(book.ids.size, CODES[word])
        yield Answers(
            name,
            ROLE_YARDSTICK,
            False,
            said,
            nothing,
            nothing == 0,
            nothing != 0,
            nothing,
            name=name,
        )


def _full_name(method: str, changed: Mapping[str, float]) -> str:
    stated = ", ".join(f"{name} = {value:g}" for name, value in changed.items())
    if stated:
        return f"{method} ({stated})"
    return method


def home_of(method: str, book: RunArrays) -> str:
    """Return where a method's constants were fitted: on this grid ("fitted here"), on loops like
    most of these ("siblings"), or on neither ("no").
    """
    known = []
    for name in book.manifest["methods"][method].get("fitted_on", ()):
        if name in grid_names():
            known.append(name)
    if book.manifest["grid"] in known:
        return "fitted here"
    return "siblings" if any(_share_within(book, name) >= _MOSTLY for name in known) else "no"


def _share_within(book: RunArrays, grid: str) -> float:
    """Return the share of a run's loops that lie within the ranges of a grid of the package, in
    dead time and shape of stiction.
    """
    within = np.zeros(book.ids.size, dtype=bool)
    blocks = packaged_grid(grid).content.block
    for process, axis in _RATIO_OF.items():
        here = [b.axes for b in blocks if b.process == process]
        if not here:
            continue
        inside = book.axes["process"] == process
        for name, values in ((axis, book.axes[axis]), ("S_over_2J", book.axes[CELL_S_OVER_2J])):
            known = []
            for axes in here:
                for v in axes.get(name, ()):
                    known.append(float(v))
            inside = inside & (values >= min(known)) & (values <= max(known))
        within |= inside
    if within.size:
        return float(within.mean())
    return 0.0


def failures(book: RunArrays) -> dict[str, int]:
    """Return on how many simulated records each method raised an error."""
    counts = (book.failed & (book.hashes != b"")).sum(axis=1)
    return dict(zip(book.methods, counts.tolist(), strict=True))


def failing_methods(book: RunArrays, allowed: float) -> dict[str, int]:
    """Return the methods that raised an error on more than a share of the simulated records, and on
    how many.
    """
    most = allowed * int((book.hashes != b"").sum())
    return {method: count for method, count in failures(book).items() if count > most}


def reference_answers(book: RunArrays) -> list[Answers]:
    """Return what classifiers answer of an oscillating loop from everything but its waveform,
    learned on other groups: `no_waveform`, and `rhythm`; nothing where a run was stored without
    what they see, as shipped verdicts are.
    """
    if not is_told(book):
        return []
    nothing = np.zeros(book.ids.size)
    rows = []
    for name in (NO_WAVEFORM, WITH_RHYTHM):
        chance, verdicts, asked = no_waveform(book, rhythm=name == WITH_RHYTHM)
        told = verdicts, chance, asked, nothing != 0, nothing
        rows.append(Answers(name, ROLE_YARDSTICK, False, *told, name=name))
    return rows


def axis_codes(book: RunArrays, axis: str) -> tuple[list[str], np.ndarray]:
    """Return the values of an axis as text, in order, and which of them each scenario has; one more
    than there are where it has none.
    """
    import pandas as pd

    codes, values = pd.factorize(book.axes[_AXIS_OF_CELL.get(axis, axis)], sort=True)
    texts = [v if isinstance(v, str) else f"{v:g}" for v in values]
    if texts[:1] == [""]:
        codes = codes - 1
        texts = texts[1:]
    return texts, np.where(codes < 0, len(texts), codes)

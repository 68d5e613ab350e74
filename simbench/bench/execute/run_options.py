"""Options of a run: those that decide its rows, and those that decide how the work is done."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict

# options that decide the loops of a run, with their names on the command line
_DECIDING = {
    "n": "--n",
    "sets": "--set",
    "axes": "--axis",
    "fresh_seeds": "--fresh-seeds",
    "with_reference": "--with-reference",
}


class RunOptions(TypedDict, total=False):
    """How a grid is run, in addition to which methods judge it and where the tables go.

    Attributes
    ----------
    plugins, valve_plugins, effect_plugins, plant_plugins, controller_plugins : iterable of Path
        Files of detectors and of parts of loops that do not belong to the package.
    backend : {"loky", "dask", "ray"}
        Library that distributes the pieces, loky when absent; `address` is the URL of a running
        scheduler.
    resume : bool
        Continue where an earlier run in the same folder stopped.
    sets, axes : mapping, optional
        Changed settings of the grid, and other values of its axes.
    fresh_seeds : bool
        Draw the grid's seed instead of using the one in its file.
    progress : bool, optional
        Show progress on stderr; None shows it on a terminal.
    with_reference : bool
        Score the run with the verdicts on this grid that are shipped with the package; it must be
        the whole grid as the package has it.
    n : int, optional
        Number of scenarios that are drawn at random from the grid, which may be of any size; the
        seed decides which. None simulates the whole grid.
    """

    plugins: Iterable[str | Path]
    valve_plugins: Iterable[str | Path]
    effect_plugins: Iterable[str | Path]
    plant_plugins: Iterable[str | Path]
    controller_plugins: Iterable[str | Path]
    backend: Literal["loky", "dask", "ray"]
    address: str | None
    resume: bool
    sets: Mapping[str, Any] | None
    axes: Mapping[str, Sequence[Any]] | None
    fresh_seeds: bool
    progress: bool | None
    with_reference: bool
    n: int | None


def find_deciding(options: RunOptions, but: Sequence[str] = ()) -> dict[str, Any]:
    """Return the given options that decide the loops, by their names on the command line."""
    given = {}
    for key, name in _DECIDING.items():
        if key not in but:
            given[name] = options.get(key)
    return {name: value for name, value in given.items() if value not in (None, False, {})}

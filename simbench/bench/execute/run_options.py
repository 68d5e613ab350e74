"""How a run is made: options that decide its rows, and options that decide how the work is done."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class RunOptions:
    """How a grid is run, in addition to which methods judge it and where the tables go.

    Attributes
    ----------
    plugins, valve_plugins, effect_plugins, plant_plugins, controller_plugins : iterable of Path
        Files of detectors and of parts of loops that do not belong to the package.
    own : mapping of str to detector
        Detectors of the caller, by name.
    backend : {"loky", "dask", "ray"}
        Library that distributes the pieces; `address` is the URL of a running scheduler.
    resume : bool
        Continue where an earlier run in the same folder stopped.
    sets, axes : mapping, optional
        Changed settings of the grid, and other values of its axes.
    fresh_seeds : bool
        Draw the grid's seed instead of using the one in its file.
    keep : int
        Number of records that are stored with the run.
    progress : bool, optional
        Show progress on stderr; None shows it on a terminal.
    with_reference : bool
        Score the run with the verdicts on this grid that are shipped with the package; it must be
        the whole grid as the package has it.
    n : int, optional
        Number of scenarios that are drawn at random from the grid, which may be of any size; the
        seed decides which. None simulates the whole grid.
    like : mapping, optional
        Manifest of a run that this one repeats; another grid, method or plug-in is refused before
        anything is simulated.
    """

    plugins: Iterable[str | Path] = ()
    backend: str = "loky"
    address: str | None = None
    resume: bool = False
    sets: Mapping[str, Any] | None = None
    axes: Mapping[str, Sequence[Any]] | None = None
    keep: int = 0
    progress: bool | None = None
    n: int | None = None
    valve_plugins: Iterable[str | Path] = ()
    effect_plugins: Iterable[str | Path] = ()
    plant_plugins: Iterable[str | Path] = ()
    controller_plugins: Iterable[str | Path] = ()
    fresh_seeds: bool = False
    own: Mapping[str, Any] | None = None
    with_reference: bool = False
    like: Mapping[str, Any] | None = None

"""Make the map of a grid: simulate a random sample of its scenarios, and predict the accuracy of
every method over its axes.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from simbench.bench.execute.run import run_grid
from simbench.bench.map.axes import BLOCK_AXIS, GridAxes
from simbench.bench.map.surrogate import (
    IF_OSCILLATING,
    NOT_COUNTED,
    RATES,
    Surrogate,
    rate_of_cells,
    rate_of_grid,
)
from simbench.bench.statistics import Estimate
from simbench.bench.store.checksums import RunError
from simbench.bench.store.reading import RunArrays
from simbench.detectors.errors import nearest
from simbench.files import URL, whole_file
from simbench.scenarios.grid import Grid, load_grid
from simbench.scenarios.sample import Sample

if TYPE_CHECKING:
    import pandas as pd

MOST_MAPPED = 10**15  # cells of a grid: numbers of scenarios are then exact as floats
_MOST_ROWS = 20_000  # cells in map.parquet; of a larger grid these are drawn at random
_SHARE, _FEWEST, _MOST = 0.1, 200, 10_000  # scenarios that are simulated by default
_AT_ONCE = 4000  # cells that are predicted at once: memory


@dataclass(frozen=True)
class GridMap:
    """A map of a grid: predicted results in each cell for every method, and estimates for the whole
    grid.
    """

    folder: Path
    sample: Sample  # of the grid, that was simulated
    axes: tuple[str, str | None]  # of the pictures; the second is None where the grid has one
    values: dict[str, list[Any]]  # of each axis, in order, as the table has them
    table: pd.DataFrame  # of map.parquet
    methods: dict[str, dict[str, Any]]  # of map.json
    # mean squared error of the predicted accuracy of scenarios out of sample
    brier: dict[str, float]

    def as_text(self) -> str:
        """Return the costs of all methods as a table, the cheapest method first."""
        lines = [
            (
                f"{len(self.sample)} of the {len(self.sample.whole)} scenarios of grid"
                f" {self.sample.name} were simulated."
            ),
            "",
            (
                f"{'method':<20}{'cost':<21}{'cost, oscillating':<21}"
                f"{'accuracy > .9':<15}{'Brier score':<13}n"
            ),
        ]
        good = (self.table.accuracy > 0.9).groupby(self.table.method).mean()
        for name in sorted(self.methods, key=lambda m: self.methods[m]["cost"]["value"] or 0.0):
            of = self.methods[name]
            costs = [
                "unknown" if of["value"] is None else "{value:.3f} ({lo:.3f}-{hi:.3f})".format(**of)
                for of in (of["cost"], of["oscillating"]["cost"])
            ]
            share = f"{100.0 * good[name]:.0f} % of cells"
            lines.append(
                f"{name:<20}{costs[0]:<21}{costs[1]:<21}{share:<15}{self.brier[name]:<13.3f}{of['n']}"
            )
        lines += [
            "",
            (
                "Cost: predicted mean cost of the whole grid, with its 95 % interval (an error"
                " costs 1, no decision 0.5), of all scenarios with a clear label and of those that"
                " oscillate. Accuracy > .9: share of the cells (combinations of axis values) for"
                " which an accuracy above 0.9 is predicted. Brier score: mean squared error of the"
                " predicted accuracy (0 is best). n: simulated scenarios with a clear label."
            ),
            f"Map, numbers and a picture per method: {self.folder}",
        ]
        return "\n".join(lines)


def map_grid(
    grid: str | Path | Grid,
    out: str | Path,
    points: int | None = None,
    methods: Iterable[str] = ("fast",),
    x: str | None = None,
    y: str | None = None,
    **settings: Any,
) -> GridMap:
    """Predict the accuracy of methods over the axes of a grid from a random sample of its
    scenarios.

    Parameters
    ----------
    grid : str, Path or Grid
        A grid of any size, by name or file; one of its axes must have two values at least.
    out : str or Path
        Folder to write: `run` (the sample, as `run_grid` writes it), `map.parquet`, `map.json`.
    points : int, optional
        Number of scenarios to simulate; default 10 % of the grid, at least 200, at most 10 000.
    methods : iterable of str
        Method ids.
    x, y : str, optional
        Axes of the pictures; default the first two that have several values.
    **settings
        Of `run_grid`: `jobs`, `backend`, `address`, `resume`, `progress`, plug-ins, thresholds.

    Returns
    -------
    GridMap
        `table` has a row for each method and cell (at most 20 000 cells; of a larger grid a random
        choice), with the axes and, averaged over the members of a cell, `cost`, `accuracy`,
        `sensitivity` and `false_positives`, each with `_lo` and `_hi`. Its 95 % intervals cover the
        sampling error of the surrogate, not a jump of accuracy between neighbouring cells that the
        forest smooths away. `methods` has the cost over the whole grid: its 95 % interval covers
        the cost that a run of the whole grid gives, whatever the surrogate is worth. As in `score`,
        answers are compared with `cycled`; loops that are entrained or unclear, and loops to which
        a method does not apply, are left out.

    Raises
    ------
    UserError
        For an unknown grid, axis or method, for more points than scenarios, and for a grid without
        axes.

    Notes
    -----
    Not for a grid of a few hundred scenarios: run it whole.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     result = map_grid(
    ...         "smoke", folder, points=6, methods=["he"], x="disturbance", progress=False)
    >>> result.axes, len(result.table)
    (('disturbance', 'Td_over_T'), 24)
    """
    if URL.match(str(out)):
        raise RunError(f"-o {out}: a map is written to a folder of this machine; a path is needed")
    plan = grid if isinstance(grid, Grid) else load_grid(grid, most_cells=MOST_MAPPED)
    axes = GridAxes(plan)
    names = _picture_axes(plan.name, axes, x, y)
    if points is None:
        points = min(len(plan), max(_FEWEST, min(int(_SHARE * len(plan)), _MOST)))
    sample, folder = Sample.of(plan, points), Path(out)
    book = RunArrays.read(run_grid(sample, folder / "run", methods, **settings))
    cells, features, rows = _sampled(sample, axes, book)
    if plan.cells > _MOST_ROWS:
        shown = np.unique(
            np.random.default_rng([plan.content.seed, points]).integers(plan.cells, size=_MOST_ROWS)
        )
    else:
        shown = np.arange(plan.cells)
    frame, members = axes.table(shown)
    # an axis replaced from outside may leave a cell without members
    frame = frame[list(map(bool, members))]
    cell = np.repeat(np.arange(len(frame)), list(filter(None, map(len, members))))
    everyone = axes.features(frame.iloc[cell], itertools.chain(*members))
    rates_of_grid: dict[str, dict[str, Any]] = {}
    brier, tables = {}, []
    truth = book.truth["cycled"]
    for name, verdict, applies in zip(
        book.methods, book.verdict, book.applicable != 0, strict=True
    ):
        outcome = np.where(
            (truth >= 0) & applies, 6 * book.oscillating + 3 * truth + verdict, NOT_COUNTED
        )
        outcome = np.append(outcome, NOT_COUNTED)[rows]
        surrogate = Surrogate.fit(features, outcome, cells)
        rates, mean = _predicted(surrogate, everyone, cell)
        tables.append(frame.assign(**rates))
        tables[-1].insert(0, "method", name)
        brier[name] = surrogate.brier()
        some = {}
        for key, only in (("all", None), ("oscillating", IF_OSCILLATING)):
            counted = outcome != NOT_COUNTED if only is None else only[outcome] > 0
            some[key] = {
                "cost": _as_json(rate_of_grid(surrogate, mean, len(plan), only)),
                "n": int(counted.sum()),
            }
        rates_of_grid[name] = {**some["all"], "oscillating": some["oscillating"]}
    import pandas as pd

    with whole_file(folder / "map.parquet", "wb") as f:
        _write_table(f, tables)
    table = pd.concat(tables, ignore_index=True)
    with whole_file(folder / "map.json") as f:
        f.write(json.dumps(rates_of_grid, indent=1, allow_nan=False) + "\n")
    return GridMap(folder, sample, names, axes.values, table, rates_of_grid, brier)


def _picture_axes(
    grid: str, axes: GridAxes, x: str | None, y: str | None
) -> tuple[str, str | None]:
    if not axes.several:
        raise RunError(f"grid {grid} has no axis with two values or more; a map needs one")
    for option, name in (("--x", x), ("--y", y)):
        if name is not None and name not in axes.several:
            raise RunError(
                f"{option} {name}: {nearest(name, axes.several)} (axes of grid {grid} with two"
                " values or more)"
            )
    if x is not None and x == y:
        raise RunError(f"--x {x} --y {y}: two different axes are needed")
    free = [key for key in sorted(axes.several, key=BLOCK_AXIS.__eq__) if key not in (x, y)]
    x = x or free.pop(0)
    return x, y or (free[0] if free else None)


def _sampled(
    sample: Sample, axes: GridAxes, book: RunArrays
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return cell and features of the scenarios drawn, and the row of each in the tables.

    -1: nowhere, as it is a healthy loop that cannot be made to oscillate as its sticky sibling
    does.
    """
    places = {place: row for row, place in enumerate(book.places.astype(str).tolist())}
    drawn = [
        (*divmod(group, sample.cells), name)
        for group, names in sample.drawn.items()
        for name in names
    ]
    _, cells, names = zip(*drawn, strict=True)
    rows = [places.get(f"{cell}/{repeat}/{name}", -1) for repeat, cell, name in drawn]
    return np.array(cells), axes.features(axes.table(cells)[0], names), np.array(rows)


def _predicted(
    surrogate: Surrogate, features: np.ndarray, cell: np.ndarray
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the rates of cells with their intervals as columns, and the mean probability of each
    outcome.

    `features` are those of the members of all cells, `cell` the place of the cell that each belongs
    to, in order.
    """
    columns: dict[str, list[np.ndarray]] = {
        f"{name}{end}": [] for name in RATES for end in ("", "_lo", "_hi")
    }
    total = np.zeros(NOT_COUNTED + 1)
    for first in range(0, int(cell[-1]) + 1, _AT_ONCE):
        here = slice(*np.searchsorted(cell, [first, first + _AT_ONCE]))
        starts = np.flatnonzero(np.diff(cell[here], prepend=-1))
        halves = np.add.reduceat(surrogate.halves(features[here]), starts, axis=1, dtype=float)
        total += halves.mean(axis=0).sum(axis=0)
        for name in RATES:
            for end, values in zip(("", "_lo", "_hi"), rate_of_cells(halves, name), strict=True):
                columns[f"{name}{end}"].append(values)
    return {name: np.concatenate(parts) for name, parts in columns.items()}, total / cell.size


def _write_table(file: IO[bytes], tables: list[pd.DataFrame]) -> None:
    """Write the tables of the methods below each other, one at a time: memory."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = (pa.Table.from_pandas(table, preserve_index=False) for table in tables)
    first = next(parts)
    with pq.ParquetWriter(file, first.schema) as writer:
        for part in itertools.chain([first], parts):
            writer.write_table(part.cast(first.schema))


def _as_json(estimate: Estimate) -> dict[str, float | None]:
    return {key: None if math.isnan(v) else v for key, v in estimate._asdict().items()}

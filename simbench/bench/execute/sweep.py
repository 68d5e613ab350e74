"""Sweep one loop over axes from Python: `simbench.sweep(loop, axes).score(detectors)` gives what
`simbench.score` gives of a run, and `rates` one table of all combinations.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbench.bench.execute.run import run_grid
from simbench.bench.score.scoring import score_run
from simbench.bench.score.tally import share_frame
from simbench.detectors.sources import Methods, named_methods
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid import make_grid
from simbench.scenarios.spec import Loop, load_loop

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.score.result import Scores


@dataclass(frozen=True)
class Sweep:
    """A loop and the values its keys shall take."""

    grid: Grid  # one cell per combination of values, one scenario per seed

    def __len__(self) -> int:
        """Number of scenarios."""
        return len(self.grid)

    def verdicts(
        self,
        detectors: Methods = ("fast",),
        jobs: int = 1,
        out: str | Path | None = None,
        **settings: Any,
    ) -> pd.DataFrame:
        """Simulate and judge; one row per scenario and method, with the axes and the truth next to
        the verdict. Detectors are method ids, functions or objects, as in `simbench.detect`.

        With `out` the tables stay in that folder, and a sweep that was interrupted goes on there.
        """
        return self._run_and_join(detectors, jobs, out, settings)

    @contextlib.contextmanager
    def _finish_sweep(
        self, detectors: Methods, jobs: int, out: str | Path | None, settings: Mapping[str, Any]
    ) -> Iterator[Path]:
        """Yield the folder in which the sweep was run."""
        names, own = named_methods(detectors)
        with _folder_of_sweep(out) as where:
            resume = {"resume": out is not None, **settings}
            yield run_grid(self.grid, where, names, jobs, own=own, **resume)

    def _run_and_join(
        self,
        detectors: Methods,
        jobs: int,
        out: str | Path | None,
        settings: Mapping[str, Any],
        columns: Mapping[str, list[str]] | None = None,
    ) -> pd.DataFrame:
        """Run the sweep on disk and join its tables; `columns` names those of each table that are
        read, next to `scenario_id`.
        """
        import pandas as pd

        with self._finish_sweep(detectors, jobs, out, settings) as folder:
            scenarios, verdicts = (
                pd.read_parquet(
                    folder / f"{table}.parquet",
                    columns=None if columns is None else ["scenario_id", *columns[table]],
                )
                for table in ("scenarios", "verdicts")
            )
        # the axes are the same in all scenarios of a cell
        first = scenarios.drop_duplicates("cell").set_index("cell").tags.map(json.loads)
        for axis in self.grid.content.axes:
            scenarios[axis] = scenarios.cell.map(first.map(lambda tags, axis=axis: tags[axis]))
        return verdicts.merge(
            scenarios.drop(columns="tags"),
            on="scenario_id",
            suffixes=("", "_scenario"),
            validate="many_to_one",
        )

    def score(
        self,
        detectors: Methods = ("fast",),
        jobs: int = 1,
        out: str | Path | None = None,
        **settings: Any,
    ) -> Scores:
        """Simulate, judge and score, as `simbench.score` does a run; `along` gives the rates over
        one axis or two. Detectors are method ids, functions or objects, as in `simbench.detect`.

        With `out` the tables stay in that folder, and a sweep that was interrupted goes on there.
        """
        with self._finish_sweep(detectors, jobs, out, settings) as folder:
            return score_run(folder)

    def rates(
        self,
        detectors: Methods = ("fast",),
        jobs: int = 1,
        out: str | Path | None = None,
        **settings: Any,
    ) -> pd.DataFrame:
        """Simulate and judge; one row per combination of axis values and method, with the shares of
        its answers. Arguments as in `score`.
        """
        axes = list(self.grid.content.axes)
        read = {"scenarios": ["cell", "cycled", "tags"], "verdicts": ["method", "verdict", "score"]}
        frame = self._run_and_join(detectors, jobs, out, settings, read)
        frame["clear"] = frame.cycled.isin(["yes", "no"])
        frame["cycling"] = frame.cycled == "yes"
        frame["stiction"] = frame.verdict == STICTION
        frame["no_decision"] = frame.verdict == NO_DECISION
        frame["right"] = frame.clear & ~frame.no_decision & (frame.stiction == frame.cycling)
        groups = frame.groupby(["cell", "method"], sort=False)
        table = groups[axes].first().assign(n=groups.size())
        for name in ("cycling", "stiction", "no_decision"):
            table[name] = groups[name].mean()
        shares = share_frame("accuracy", groups.right.sum(), groups.clear.sum())
        table = table.join(shares).assign(score=groups.score.median()).reset_index()
        return table.loc[:, [*axes, "method", *table.columns.drop([*axes, "cell", "method"])]]


@contextlib.contextmanager
def _folder_of_sweep(out: str | Path | None) -> Iterator[str | Path]:
    """Yield the folder of a sweep: the one that is asked for, or one that is removed again."""
    if out is not None:
        yield out
        return
    with tempfile.TemporaryDirectory() as where:
        yield Path(where) / "run"


def sweep(
    loop: Loop | str | Path, axes: Mapping[str, Sequence[Any]], seeds: int = 1, seed: int = 0
) -> Sweep:
    """Plan a sweep of one loop over the product of some axes.

    Parameters
    ----------
    loop : Loop, str or Path
        A loop, or a loop file.
    axes : mapping of str to sequence
        Dotted loop keys ("valve.J", "noise.std"); the ratios Td_over_T (or Td_over_Ti), which sets
        the dead time, and S_over_2J, which sets J beside the valve's S (inf: dead-band, 0: a
        healthy valve), while the controller stays as it is; or the rules samples_per_period with
        periods, and noise_ratio.
    seeds : int
        Scenarios per combination; only noise and random disturbances differ between them.
    seed : int
        Root of all of them.

    Returns
    -------
    Sweep
        The scenarios of the product; `len` of it is their number.

    Raises
    ------
    SpecError
        For a key or value the loop does not allow.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "integrating", "K": 1}, "controller": {"type": "P", "Kc": 1},
    ...     "valve": {"model": "deadband", "S": 1}, "sampling": {"Ts": 1}})
    >>> len(sweep(loop, {"valve.S": [1, 2, 5], "noise.std": [0, 0.1]}, seeds=4))
    24
    """
    content = loop.to_table() if isinstance(loop, Loop) else load_loop(loop).to_table()
    table = {
        "title": "sweep",
        "seed": seed,
        "repeats": seeds,
        "loop": content,
        "axes": {k: list(v) for k, v in axes.items()},
    }
    return Sweep(make_grid(table, "sweep"))

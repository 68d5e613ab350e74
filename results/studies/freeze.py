"""Settle grids of the package and write their frozen tables: `python -m results.studies.freeze
[GRID ...]`.

A table belongs to a version: where it changes, the version of its grid rises by one.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from joblib import Parallel, delayed

from simbench.bench.execute.compute_piece import scenario_columns
from simbench.bench.execute.settle_group import settled
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.files import whole_file
from simbench.progress import Progress
from simbench.scenarios.grid import packaged_grid
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.settled import table_file, table_of
from simbench.usage import exit_code

_GROUPS = 20  # settled at a time
_DRAWN = [name for name in grid_names() if not packaged_grid(name).frozen]


def frozen(name: str, jobs: int = 1) -> bytes:
    """Settle a grid of the package and return its table."""
    count = packaged_grid(name).group_count
    pieces = [range(i, min(i + _GROUPS, count)) for i in range(0, count, _GROUPS)]
    work = (delayed(_rows)(name, groups) for groups in pieces)
    done = Parallel(n_jobs=jobs, return_as="generator")(work)
    return table_of(row for rows in Progress(done, total=len(pieces), desc=name) for row in rows)


def _rows(name: str, groups: range) -> list[dict]:
    """Return the rows of some groups; UserError where a cell cannot be settled."""
    rows = []
    with one_thread():
        for index in groups:
            for scenario, wrong in settled(packaged_grid(name).group(index)):
                if wrong is not None:
                    raise UserError(f"grid {name}: group {index} cannot be settled: {wrong}")
                rows.append(scenario_columns(scenario, index))
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Write the tables of the chosen grids, or of all."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.freeze", description=__doc__)
    parser.add_argument("grids", metavar="GRID", nargs="*", default=_DRAWN)
    parser.add_argument("-j", type=int, default=1, dest="jobs", help="Worker processes [1].")
    chosen = parser.parse_args(arguments)
    for name in chosen.grids:
        table = frozen(name, chosen.jobs)
        with whole_file(Path(str(table_file(name))), "wb") as f:
            f.write(table)
        print(f"{name}: {len(table)} bytes")
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

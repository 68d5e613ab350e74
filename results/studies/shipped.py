"""Print the verdicts that simbench ships: `python -m results.studies.shipped [GRID ...]`.

They are of one version of the benchmark. Where a change of the code gives it another hash, but no
record and no verdict another value, `--again SHARE` asks a share of the loops again and, where all
agree, writes the new version into the manifests.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq

from simbench.bench.check.baseline import write_shipped
from simbench.bench.execute.compute_piece import PieceSettings, compute_piece
from simbench.bench.execute.run import run_grid
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.shipped import FOLDER, results, shipped
from simbench.bench.store.benchmark import BENCHMARK, benchmark_of
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.reading import RunArrays
from simbench.progress import Progress
from simbench.scenarios.settled import settled_grid
from simbench.usage import exit_code

GRIDS = ("ci", "chapter", "table-11-3", "plant", "families", "recorded")
METHODS = ("full", "likelihood", ORACLE)
_COMPARED = ["scenario_id", "record_hash", "cycled", "sticky"]


class Again(NamedTuple):
    """What came out when some loops were asked again."""

    loops: int
    other_bits: int  # loops whose records have other bits, as on another processor
    differ: tuple[str, ...]  # what is otherwise on a loop with equal bits, a sentence each

    def __str__(self) -> str:
        """Return one line."""
        same = self.loops - self.other_bits
        return (
            f"{self.loops} loops asked again: {same} with equal bits, on which"
            f" {len(self.differ)} answers or labels differ"
        )


def ask_again(name: str, share: float, seed: int = 0, but: Sequence[str] = ()) -> Again:
    """Simulate a share of a grid's groups, drawn by a seed, and judge them by all shipped methods
    `but` some; compare with what is shipped.
    """
    grid = settled_grid(name)
    rng = np.random.default_rng(seed)
    count = max(round(share * grid.group_count), 1)
    groups = sorted(rng.choice(grid.group_count, count, replace=False).tolist())
    methods = tuple(m for m in read_manifest(shipped(name))["methods"] if m not in but)
    loops = other = 0
    differ: list[str] = []
    given = results(name).set_index(["scenario_id", "method"])
    for group in Progress(groups, total=count, desc=name):
        piece = compute_piece(grid, 0, [group], PieceSettings(methods))
        tables = {k: pq.read_table(io.BytesIO(v)).to_pandas() for k, v in piece.tables.items()}
        about = tables["scenarios"][_COMPARED]
        here = tables["verdicts"].merge(about, on="scenario_id")
        here = here.set_index(["scenario_id", "method"])
        there = given.loc[here.index]
        same = here["record_hash"] == there["record_hash"]
        loops += len(about)
        other += int((~same).groupby("scenario_id").any().sum())
        for what in ("verdict", "cycled", "sticky"):
            odd = same & (here[what] != there[what])
            differ += [f"{m} on {i}: {what}" for i, m in here.index[odd]]
    return Again(loops, other, tuple(differ))


def stamp(name: str) -> None:
    """Write the version of the benchmark that this code has into the manifest of shipped
    verdicts.
    """
    folder = shipped(name)
    book = RunArrays.read(folder)
    version = benchmark_of(settled_grid(name), book.table)
    write_manifest(folder, {**book.manifest, BENCHMARK: version})


def main(arguments: list[str] | None = None) -> int:
    """Print the verdicts on the chosen grids, or ask a share of them again; 1 where one differs."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.shipped", description=__doc__)
    parser.add_argument("grids", metavar="GRID", nargs="*", default=GRIDS)
    parser.add_argument("-j", type=int, default=1, dest="jobs", help="Worker processes [1].")
    parser.add_argument("-o", default="runs/shipped", dest="out", help="Folder of the runs.")
    parser.add_argument("--again", type=float, metavar="SHARE", help="Only ask this share again.")
    parser.add_argument("--seed", type=int, default=0, help="Of the groups asked again [0].")
    chosen = parser.parse_args(arguments)
    failed = False
    for name in chosen.grids:
        if chosen.again is not None:
            found = ask_again(name, chosen.again, chosen.seed)
            print("\n".join([f"{name}: {found}", *found.differ]))
            failed = failed or bool(found.differ)
            if not found.differ and found.other_bits < found.loops:
                stamp(name)
            continue
        run = run_grid(name, Path(chosen.out) / name, METHODS, chosen.jobs, resume=True)
        write_shipped(run, FOLDER / name)
        book = RunArrays.read(shipped(name))
        print(f"{name}: {book.ids.size} loops, {len(book.methods)} methods")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

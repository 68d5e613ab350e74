"""Does the order of the methods on a grid hold on recorded loops? `python -m
results.studies.agreement FOLDER...` prints the AUC of every method without MV on grids of the
package, as shipped, and on the labelled loops of the folders, and Spearman's correlation between
both.

The loops of grid `recorded` copy some of the recorded ones. So the units are halved, many times:
one half has the grid's loops, the other judges; for every grid on the same halves. Intervals by
drawing the units of both halves again, which draws the correlation towards 0 as well.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import spearmanr

from results.studies.claims.judged import in_the_middle, labelled, records_of
from results.studies.plant.real_loops import read
from results.studies.transfer import methods
from simbench.bench.score.shipped import results
from simbench.bench.statistics import area, dense_ranks
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import STICTION
from simbench.detectors.views import columns
from simbench.scenarios.settled import settled_grid
from simbench.usage import exit_code

GRIDS, SEED, DRAWS = ("chapter", "plant", "families", "recorded"), 20261201, 500
COPIES = "recorded"  # the grid whose loops copy recorded ones


class Scored(NamedTuple):
    """What methods say of loops: scores, shape (methods, loops), larger where stiction is likelier
    and NaN without one; whether the valve makes them cycle, or sticks; and their units.
    """

    score: np.ndarray
    sticky: np.ndarray
    unit: np.ndarray

    def of(self, at: np.ndarray) -> Scored:
        """Return some of the loops."""
        return Scored(self.score[:, at], self.sticky[at], self.unit[at])


def areas(loops: Scored) -> np.ndarray:
    """Return the AUC of each method, NaN where all loops are of one kind; loops without a score
    stand in the middle of the others.
    """
    return np.array([area(dense_ranks(in_the_middle(s)), loops.sticky) for s in loops.score])


def of_grid(name: str, names: Sequence[str], units: dict[str, str]) -> Scored:
    """Return what is shipped of a grid's loops whose cycle has a clear cause."""
    said = results(name)
    said = said[said.method.isin(names) & said.cycled.isin(("yes", "no"))]
    table = said.pivot(index="scenario_id", columns="method", values="score")[list(names)]
    grid = settled_grid(name)
    record = {d.id: str(d.tags.get("record", d.id)) for g in grid.groups() for d in g.drafts}
    cycled = said.drop_duplicates("scenario_id").set_index("scenario_id").cycled[table.index]
    unit = [units.get(record[i], record[i]) for i in table.index]
    return Scored(table.to_numpy(float).T, (cycled == "yes").to_numpy(), np.array(unit))


def of_folders(folders: Sequence[Path], names: Sequence[str], jobs: int) -> Scored:
    """Return what methods say of the labelled loops of folders."""
    rows = labelled(folders)
    calls = (delayed(_scores)(record, names) for record in records_of(rows))
    score = np.array(Parallel(n_jobs=jobs)(calls), dtype=float).T
    return Scored(score, (rows.label == STICTION).to_numpy(), rows.unit_group.to_numpy(str))


def _scores(record: LoopRecord, names: Sequence[str]) -> list[float]:
    return [v.score for v in judge(record, list(names))]


def halves(grid: Scored, real: Scored, copies: bool) -> list[tuple[float, float]]:
    """Return Spearman's correlation on halves of the units, as they are and with the units drawn
    again; of a grid that copies recorded loops, those of the other half.
    """
    rng, found = np.random.default_rng(SEED), []
    units = np.unique(real.unit)
    for _ in range(DRAWS):
        judging = rng.permutation(units)[: units.size // 2]
        there = real.of(np.isin(real.unit, judging))
        here = grid.of(~np.isin(grid.unit, judging)) if copies else grid
        drawn = (_drawn_again(here, rng), _drawn_again(there, rng))
        found.append((_correlation(here, there), _correlation(*drawn)))
    return found


def _drawn_again(loops: Scored, rng: np.random.Generator) -> Scored:
    """Return the loops of as many units, drawn with replacement."""
    order = np.argsort(loops.unit, kind="stable")
    ends = np.flatnonzero(np.r_[loops.unit[order][1:] != loops.unit[order][:-1], True]) + 1
    own = np.split(order, ends[:-1])
    chosen = rng.integers(len(own), size=len(own))
    return loops.of(np.concatenate([own[k] for k in chosen]))


def _correlation(here: Scored, there: Scored) -> float:
    one, other = areas(here), areas(there)
    return float(spearmanr(one, other).statistic) if np.isfinite([one, other]).all() else np.nan


def main(words: Sequence[str] | None = None) -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    asked = parser.parse_args(words)
    names = methods()
    real = of_folders(asked.folders, names, asked.jobs)
    rows = read(asked.folders)
    units = dict(zip(rows.id, rows.unit_group, strict=True))
    grids = {name: of_grid(name, names, units) for name in GRIDS}
    print(f"{real.sticky.size} recorded loops, {real.sticky.sum()} sticky, of", end=" ")
    print(f"{np.unique(real.unit).size} units; seed {SEED}; AUC of each method's score\n")
    found = {**{name: areas(loops) for name, loops in grids.items()}, "real": areas(real)}
    order = np.argsort(-found[COPIES])
    lines = [("method", *found)]
    lines += [(names[k], *(f"{x[k]:.2f}" for x in found.values())) for k in order]
    print("\n".join(columns(lines)))
    print(
        f"\nSpearman's correlation with recorded loops, {len(names)} methods; on all of these, and"
    )
    print(
        f"on halves of their units (median of {DRAWS}, and 95 % of those with units drawn again)\n"
    )
    lines = [("grid", "all", "halves", "lo", "hi")]
    for name, loops in grids.items():
        plain, again = np.array(halves(loops, real, name == COPIES)).T
        ends = np.nanquantile(again, (0.025, 0.975))
        numbers = (_correlation(loops, real), np.nanmedian(plain), *ends)
        lines.append((name, *(f"{x:.2f}" for x in numbers)))
    print("\n".join(columns(lines)))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

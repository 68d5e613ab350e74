"""How do grids differ from recorded loops? `python -m results.studies.grid_gaps FOLDER...` prints,
for every grid of the package and for the grid of the loops that copy the records, how well a
classifier tells it from the records of the folders (each with its table records.csv, which states
the units), and whether what is left out is told as well: half of the units make a grid, the other
half judges it.

With `--known N` no folder is read: N times, loops of `chapter` that lack one known thing are
compared with other loops of `chapter`, and it is counted how often the right block is named.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from joblib import delayed

from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder, read_labels
from simbench.detectors.views import columns
from simbench.gap.benchmark import measure
from simbench.gap.benchmark.from_records import grid_from_records
from simbench.gap.benchmark.measure import describe, draw_loops, tell_apart, with_nuisances
from simbench.gap.benchmark.nuisances import ADDITIONS
from simbench.parallel import run_parallel
from simbench.scenarios.expansion import Grid
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.settled import settled_grid
from simbench.usage import exit_code

SEED, LOOPS = 20261129, 130
KNOWN_LOOPS = 60  # on each side of a known difference
KNOWN = ("quantisation in the archive", "coloured load on PV", "derivative action")
Records = Mapping[str, LoopRecord]


def told(grid: Grid, records: Records, units: Mapping[str, str]) -> str:
    """Return how well a grid is told from records, with its interval."""
    drawn = draw_loops(grid, LOOPS, SEED)
    whose = [units.get(name, name) for name in (*(d.unit for d in drawn), *records)]
    simulated = describe([d.record for d in drawn])
    auc, _ = tell_apart(simulated, describe(list(records.values())), whose, SEED)
    return f"{auc.value:.2f} ({auc.lo:.2f} to {auc.hi:.2f})"


def read(folders: Sequence[str]) -> tuple[dict[str, LoopRecord], dict[str, str]]:
    """Return the records of folders, once where one is in several, and their units."""
    records, units = {}, {}
    for folder in folders:
        records |= read_folder(folder)[0]
        table = read_labels(Path(folder) / "records.csv")
        units |= {name: row["unit_group"] for name, row in table.items()}
    return records, units


def halves(records: Records, units: Mapping[str, str]) -> list[dict[str, LoopRecord]]:
    """Return the records of one half of the units, and those of the other."""
    own = np.unique([units.get(name, name) for name in records])
    chosen = set(np.random.default_rng(SEED).permutation(own)[: own.size // 2].tolist())
    return [
        {name: r for name, r in records.items() if (units.get(name, name) in chosen) == side}
        for side in (True, False)
    ]


def of_folders(folders: Sequence[str], jobs: int) -> list[str]:
    """Return the table of the grids."""
    records, units = read(folders)
    count = len({units.get(name, name) for name in records})
    rows = [("grid", "told from recorded loops with AUC")]
    names = [name for name in grid_names() if name != "smoke"]
    calls = [delayed(told)(settled_grid(name), records, units) for name in names]
    rows += zip(names, run_parallel(calls, jobs, "grids"), strict=True)
    with tempfile.TemporaryDirectory() as place:
        made = grid_from_records(records, "records", jobs=jobs, kept=Path(place))
        rows.append(("of these records", told(made.grid, records, units)))
        one, other = halves(records, units)
        for side, (of, by) in {"one half": (one, other), "the other half": (other, one)}.items():
            grid = grid_from_records(of, "half", jobs=jobs, kept=Path(place)).grid
            rows.append((f"of {side}, judged by the rest", told(grid, by, units)))
    said = f"{len(records)} records of {count} units, {LOOPS} loops of each grid, seed {SEED}"
    near = f"{len(made.loops)} records have a loop that is near them"
    return [said, near, "", *columns(rows)]


def known_difference(name: str, draw: int) -> tuple[str, float, float]:
    """Return the block that is named where loops lack a known thing, and the AUC before and after
    it is added.
    """
    grid, seed = settled_grid("chapter"), SEED + draw
    drawn = draw_loops(grid, 2 * KNOWN_LOOPS, seed)
    here, there = drawn[::2], drawn[1::2]
    lent = [one.record for one in here]
    changed = with_nuisances(there, [(name, 1.0)], lent, seed + 1)
    recorded = {f"r {one.unit} {k}": one.record for k, one in enumerate(changed)}
    units = {name: name.rpartition(" ")[0] for name in recorded}
    search = measure.Search(list(here), recorded, units, seed, 1)
    before = search.ask([()])[0]
    singles = search.ask([((one, 1.0),) for one in ADDITIONS])
    best = min(singles, key=lambda one: one.certain)
    right = next(one for one in singles if one.chosen[0][0] == name)
    return ADDITIONS[best.chosen[0][0]].block, before.auc.value, right.auc.value


def of_known(draws: int, jobs: int) -> list[str]:
    """Return the table of known differences."""
    calls = [delayed(known_difference)(name, k) for name in KNOWN for k in range(draws)]
    found = run_parallel(calls, jobs, "known differences")
    rows = [("lacking", "right block", "AUC before", "with it", "largest with it")]
    for place, name in enumerate(KNOWN):
        own = found[place * draws : (place + 1) * draws]
        right = sum(block == ADDITIONS[name].block for block, _, _ in own)
        before, after = (np.array([x[k] for x in own]) for k in (1, 2))
        numbers = (before.mean(), after.mean(), after.max())
        rows.append((name, f"{right} of {draws}", *(f"{x:.2f}" for x in numbers)))
    calls = [delayed(_no_difference)(k) for k in range(draws)]
    same = np.array(run_parallel(calls, jobs, "no difference"))
    rows.append(("nothing", "", f"{same.mean():.2f}", "", f"{same.max():.2f}"))
    return [
        f"grid chapter, {KNOWN_LOOPS} loops on each side, {draws} draws, seed {SEED}",
        "",
        *columns(rows),
    ]


def _no_difference(draw: int) -> float:
    drawn = draw_loops(settled_grid("chapter"), 2 * KNOWN_LOOPS, SEED + draw)
    sides = drawn[::2], drawn[1::2]
    whose = [f"{name} {d.unit}" for name, side in zip("sr", sides, strict=True) for d in side]
    one, other = (describe([d.record for d in side]) for side in sides)
    return tell_apart(one, other, whose, SEED + draw)[0].value


def main(words: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("folders", nargs="*")
    parser.add_argument("--known", type=int, metavar="N")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    asked = parser.parse_args(words)
    if (asked.known is None) == (not asked.folders):
        raise ParameterError("grid_gaps: folders of records, or --known N; one of both is needed")
    lines = (
        of_folders(asked.folders, asked.jobs)
        if asked.folders
        else of_known(asked.known, asked.jobs)
    )
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

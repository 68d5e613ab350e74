"""Does the seed of the simulations decide a gap? `python -m results.studies.plant.gap_seeds FOLDER
...` diagnoses recorded loops with three seeds and counts what changes.

A folder holds records; which are asked is drawn by the seed. No label is looked at.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed

from simbench.detectors.errors import UserError
from simbench.gap import GapReport, diagnose
from simbench.usage import exit_code

SEEDS = (0, 100, 200)  # farther apart than a loop has simulations


def asked(file: Path) -> list[GapReport]:
    """Return the diagnosis with each seed; none of a file that is no record of a loop."""
    warnings.simplefilter("ignore")
    try:
        return [diagnose(file, identify=True, seed=seed) for seed in SEEDS]
    except UserError:
        return []


def main(arguments: Sequence[str] | None = None) -> int:
    """Print how far gaps scatter from seed to seed, and how many answers the seed decides."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("-n", type=int, default=40, metavar="RECORDS")
    parser.add_argument("--seed", type=int, default=919)
    chosen = parser.parse_args(arguments)
    files = sorted(f for folder in chosen.folders for f in folder.glob("*.csv"))
    drawn = np.random.default_rng(chosen.seed).permutation(len(files))[: chosen.n]
    every = [one for one in Parallel(2)(delayed(asked)(files[i]) for i in drawn) if one]
    if not every:
        raise UserError(f"{chosen.folders[0]}: no record of a loop; one is needed")
    gaps = np.array([[report.gap.before for report in reports] for reports in every])
    scatter = float(np.mean(gaps.std(axis=1, ddof=1) / gaps.mean(axis=1)))
    effect, resolved = (
        sum(len({answer(report) for report in reports}) > 1 for reports in every)
        for answer in (lambda report: report.effect, lambda report: report.gap.resolvable)
    )
    print(
        f"{len(every)} records, seed {chosen.seed}; simulations with seeds {SEEDS}\n"
        f"gap before: standard deviation over mean {scatter:.3f}\n"
        f"of so many records another seed names another effect: {effect}\n"
        f"of so many it decides whether the gap can be resolved: {resolved}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

"""A diagnosis that asks: sealed records of every world, scored alone, after one test and after two.

`python -m results.studies.asking DIR` makes, answers and opens what is not there yet, and prints the table.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from simbench.blind.answering import answer
from simbench.blind.making import PLANTS, make
from simbench.blind.opening import open_
from simbench.blind.world import PLANNED
from simbench.gap.command import one_file

SEEDS = {"own": 310711, "mill": 310712, "refinery": 310713}  # named before anything was answered
TESTS = 2
_NEEDS_T = "time_constant_mismatch"
FIGURES = {
    "first": ("single", "first"), "group": ("single", "in_group"), "block": ("single", "block_right"),
    "called unknown": ("single", "called_unknown"), "both of two": ("two", "both_named"),
}  # fmt: skip


@dataclass(frozen=True)
class Mixture:
    """Medium and strong single effects, none, two and foreign, in fixed numbers; effects drawn without return."""

    seed: int
    single: int = 16
    none: int = 4
    two: int = 3
    foreign: int = 3

    def entries(self, foreign: list[str]) -> list[dict[str, Any]]:
        """Return one entry per record, as a world draws it."""
        rng = np.random.default_rng(self.seed)
        turns = -(-self.single // len(PLANNED))
        effects = [str(e) for _ in range(turns) for e in rng.permutation(PLANNED)][: self.single]
        out = [
            {
                "kind": "single", "effect": e, "strength": ("medium", "strong")[i % 2], "mv": i % 3 == 0,
                "plant": PLANTS[0] if e == _NEEDS_T else PLANTS[i % 3],
            }
            for i, e in enumerate(effects)
        ]  # fmt: skip
        strange = [str(e) for e in rng.permutation(foreign)]
        out += [
            {"kind": "foreign", "effect": strange[i % len(strange)], "strength": ("medium", "strong")[i % 2], "mv": i % 3 == 0}
            for i in range(self.foreign)
        ]
        return out + [{"kind": k, "mv": i % 3 == 0} for k in ("none", "two") for i in range(getattr(self, k))]


def table(folder: Path) -> pd.DataFrame:
    """Return a row per world and number of tests."""
    rows = []
    for world in SEEDS:
        for tests in range(TESTS + 1):
            file = folder / f"{world}-score" / (f"records-{tests}.csv" if tests else "records.csv")
            if not file.exists():
                continue
            found = pd.read_csv(file, keep_default_na=False)
            row: dict[str, Any] = {"world": world, "tests": tests, "n": len(found)}
            for name, (kind, column) in FIGURES.items():
                row[name] = _share(_true(found[found.kind == kind][column]))
            none, foreign = found[found.kind == "none"], found[found.kind == "foreign"]
            row["named where none is"] = _share(~_true(none.called_none) & ~_true(none.called_unknown))
            row["foreign unknown or block"] = _share(_true(foreign.called_unknown) | _true(foreign.block_right))
            known = found[found.kind.isin(["single", "none"])]
            row["right where p > .9"] = _share(_true(known[known.probability.astype(float) > 0.9]["first"]))
            rows.append(row)
    return pd.DataFrame(rows)


def _true(x: pd.Series) -> pd.Series:
    return x.astype(str) == "True"


def _share(x: pd.Series) -> str:
    return f"{int(x.sum())}/{len(x)}"


def main() -> None:
    """Make, answer and open what is not there yet; print the table, and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", type=Path, help="CSV to write the table to.")
    parser.add_argument("--worlds", nargs="*", default=list(SEEDS))
    given = parser.parse_args()
    for world in given.worlds:
        check, key = given.folder / world, given.folder / f"{world}.key"
        if not (check / "records").exists():
            make(check, key, SEEDS[world], plan=Mixture(SEEDS[world]), world=world, tests=True)
        answer(check, one_file, 1, TESTS)
        open_(check, key, given.folder / f"{world}-score", world)
    found = table(given.folder)
    if given.o:
        found.to_csv(given.o, index=False)
    print(found.to_string(index=False))


if __name__ == "__main__":
    main()

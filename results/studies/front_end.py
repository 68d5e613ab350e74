"""Front end: of the cycling loops of every valve family, how many are seen to oscillate, by the
period and by the swings.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.detectors.prepared import prepare
from simbench.detectors.report.report import table
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

SEED = 4321  # of no loop on which a limit was chosen
STRONG = "buried"  # disturbances that are larger than the cycle itself: counted apart
REST = "not cycling"


def loops(
    grid: str, every: int, seed: int = SEED, repeats: int = 1
) -> Iterator[tuple[str, bool, list[bool]]]:
    """Yield family (or `REST`), whether the disturbance is strong, and: sustained, by its
    swings.
    """
    content = load_grid(grid, {"seed": seed, "repeats": repeats})
    for index in range(0, content.group_count, every):
        for scenario in resolve(content.group(index)):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            if cycled.answer not in ("yes", "no"):
                continue
            record = run.record.without_mv()
            drawn = prepare(record).oscillation
            family = str(scenario.tags["valve"]) if cycled.answer == "yes" else REST
            yield (
                family,
                scenario.tags["disturbance"] == STRONG,
                [drawn.sustained, drawn.swings > 0],
            )


def rows(grid: str, every: int, seed: int = SEED, repeats: int = 1) -> list[dict[str, Any]]:
    """Return per family: n, share sustained, of these by the swings; strong disturbances apart."""
    rows_: dict[tuple[bool, str], list[list[bool]]] = {}
    for family, strong, verdicts in loops(grid, every, seed, repeats):
        rows_.setdefault((strong, family), []).append(verdicts)
    head = ("sustained", "by its swings")
    return [
        {"disturbance": STRONG if strong else "other", "family": family, "n": len(verdicts)}
        | {key: f"{share:.3f}" for key, share in zip(head, np.mean(verdicts, axis=0), strict=True)}
        for (strong, family), verdicts in sorted(rows_.items())
    ]


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.front_end`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.front_end", description=__doc__
    )
    parser.add_argument("--grid", default="families")
    parser.add_argument("--every", type=int, default=1, help="one group in so many")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument(
        "--repeats",
        type=int,
        default=1,
        help="draws of each cell; 4 give 100 cycling loops of each family",
    )
    chosen = parser.parse_args(arguments)
    groups = "every group" if chosen.every == 1 else f"one group in {chosen.every}"
    draws = "one draw" if chosen.repeats == 1 else f"{chosen.repeats} draws"
    print(f"{groups} of {chosen.grid}, {draws} of each cell, seed {chosen.seed}; shares of n")
    print("\n".join(table(rows(chosen.grid, chosen.every, chosen.seed, chosen.repeats))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))

"""Methods as published beside the same improved: what each rule of our own gains on simulated and on real loops."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from detectors.judge import judge_one
from detectors.plugins.registry import methods as registry
from detectors.prepared import prepare
from detectors.report.report import judge_files, table
from detectors.verdict import NO_DECISION, STICTION
from scenarios.grid import load_grid
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.bench.statistics import mcnemar
from simbench.usage import exit_code

GRIDS = {"plant": 1, "chapter": 4}  # every so many-th group
SEED = 20131  # of no grid: no rule was found on these loops
IMPROVED, PUBLISHED = "improved", "as published"


def variants() -> Iterator[tuple[str, str, dict[str, float]]]:
    """Yield every method that has rules of our own: improved, without one of them, and as published.

    Yields
    ------
    method, variant : str
    thresholds : dict of str to float

    Examples
    --------
    >>> [v for m, v, _ in variants() if m == "rossi_scali"]
    ['improved', 'as published']
    """
    for name in registry.names():
        method = registry.load(name).METHOD
        if method.published:
            yield name, IMPROVED, method.defaults()
            rules = method.published if len(method.published) > 1 else {}
            for key, value in rules.items():
                yield name, f"{key} = {value:g}", method.defaults() | {key: value}
            yield name, PUBLISHED, method.as_published().defaults()


def simulated(grid: str, every: int, seed: int = SEED) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Judge the loops of a grid by every variant.

    Parameters
    ----------
    grid : str
        Name or path.
    every : int
        Every so many-th group of it.
    seed : int
        In place of the grid's own.

    Returns
    -------
    said : ndarray of int, shape (variants, loops)
        1 stiction, 0 none, -1 no decision.
    applies : ndarray of bool, shape (variants, loops)
    cycling : ndarray of bool, shape (loops,)
    """
    content = load_grid(grid, {"seed": seed, "repeats": 1})
    said, applies, cycling = [], [], []
    for index in range(0, content.group_count, every):
        for scenario in resolve(content.group(index)):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            if cycled.answer not in ("yes", "no"):
                continue
            prepared = prepare(run.record.blind())
            found = [judge_one(m, registry.load(m), prepared, False, chosen) for m, _, chosen in variants()]
            said.append([-1 if v.verdict == NO_DECISION else int(v.verdict == STICTION) for v in found])
            applies.append([v.applicable is not False for v in found])
            cycling.append(cycled.answer == "yes")
    return np.array(said).T, np.array(applies).T, np.array(cycling)


def rows(grids: dict[str, int], records: Path, labels: Path, seed: int = SEED) -> list[dict[str, object]]:
    """Return one row per variant.

    Parameters
    ----------
    grids : dict of str to int
        Grid and every so many-th group of it.
    records, labels : Path
        Folder of real records and the table of their labels; left out where absent.
    seed : int
        In place of the grids' own.

    Returns
    -------
    list of dict
        method, variant; per grid: right (share of the loops that apply; no decision is wrong), found, false alarms, no
        decision, gain of the improved method over this variant with McNemar's p; on real units: found, false alarms, undecided.
    """
    table_rows: list[dict[str, object]] = [{"method": m, "variant": v} for m, v, _ in variants()]
    for grid, every in grids.items():
        said, applies, cycling = simulated(grid, every, seed)
        best = 0
        for i, row in enumerate(table_rows):
            best = i if row["variant"] == IMPROVED else best
            row |= _columns(grid, said[i], applies[i], cycling, said[best])
    if labels.exists():
        for row, (method, _, chosen) in zip(table_rows, variants(), strict=True):
            unit = judge_files(records, [method], labels=labels, thresholds={method: chosen}).scores[0]
            row["real found"] = f"{unit['found']}/{unit['n_stiction']}"
            row["false"] = f"{unit['false_alarms']}/{unit['n_other']}"
            row["open"] = str(unit["undecided"])
    return table_rows


def _columns(grid: str, said: np.ndarray, applies: np.ndarray, cycling: np.ndarray, best: np.ndarray) -> dict[str, object]:
    said, best, cycling = said[applies], best[applies], cycling[applies]
    right, other = said == cycling, best == cycling
    lost, won = int((right & ~other).sum()), int((other & ~right).sum())
    gain = f"{other.mean() - right.mean():+.3f} p {mcnemar(lost, won):.2g}" if lost + won else ""
    return {
        grid: f"{right.mean():.3f} of {right.size}",
        f"{grid} found": f"{(said[cycling] == 1).mean():.3f}",
        f"{grid} false": f"{(said[~cycling] == 1).mean():.3f}",
        f"{grid} open": f"{(said == -1).mean():.3f}",
        f"{grid} gain": gain,
    }


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.published --records FOLDER`.

    Parameters
    ----------
    arguments : list of str, optional
        In place of sys.argv.

    Returns
    -------
    int
    """
    parser = argparse.ArgumentParser(prog="python -m results.studies.published", description=__doc__)
    parser.add_argument("--records", type=Path, default=Path("../shared/data/real"), help="real records with a records.csv")
    parser.add_argument("--every", type=int, default=1, help="every so many-th of the groups looked at by default")
    chosen = parser.parse_args(arguments)
    grids = {grid: every * chosen.every for grid, every in GRIDS.items()}
    looked = ", ".join(f"every {every}th group of {grid}" for grid, every in grids.items())
    print(f"{looked}, seed {SEED}, truth: cycled, with the oscillation front end")
    print("gain: how much more often the improved method is right than this variant; with McNemar's p")
    print("\n".join(table(rows(grids, chosen.records, chosen.records / "records.csv"))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))

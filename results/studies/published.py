"""Methods as published and improved: what each added rule gains on simulated and
on real loops.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.bench.statistics import mcnemar
from simbench.detectors.detection import judge_files
from simbench.detectors.judge import judge_one
from simbench.detectors.plugins.registry import PUBLISHED as PUBLISHED_ID
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_labels
from simbench.detectors.report.report import score_units, table
from simbench.detectors.verdict import NO_DECISION, STICTION, Verdict
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

GRIDS = {"plant": 1, "chapter": 4}  # every so many-th group
SEEDS = (20131, 771301)  # of no grid: no rule was developed on these loops
IMPROVED, PUBLISHED, CHAPTER = "improved", "as published", "as in the chapter"
NO_RULE = "as published: no rule of our own"


def variants() -> Iterator[tuple[str, str, dict[str, float]]]:
    """Yield every method: improved, without one of the added rules, as published, and as in the
    chapter where that differs.

    Yields (method, variant, thresholds). A method without an added rule is the published one on
    the part that is judged.
    """
    for name in registry.names():
        method = registry.load(name).METHOD
        yield name, IMPROVED if method.published else NO_RULE, method.defaults()
        rules = method.published | method.chapter
        for key, value in rules.items() if len(rules) > 1 else ():
            yield name, f"{key} = {value:g}", method.defaults() | {key: value}
        if method.published:
            yield name, PUBLISHED, method.as_published().defaults()
        if method.chapter:
            yield name, CHAPTER, method.as_published(chapter=True).defaults()


def simulated(grid: str, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Judge the loops of a grid by every variant.

    Returns said (variants, loops): 1 stiction, 0 none, -1 no decision; applies (variants, loops);
    cycling (loops,).
    """
    verdicts, applies, cycling = [], [], []
    for content in (load_grid(grid, {"seed": seed, "repeats": 1}) for seed in SEEDS):
        for scenario in chain.from_iterable(
            resolve(content.group(i)) for i in range(0, content.group_count, every)
        ):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            if cycled.answer not in ("yes", "no"):
                continue
            columns = _answers(run.record)
            verdicts.append(
                [-1 if v.verdict == NO_DECISION else int(v.verdict == STICTION) for v in columns]
            )
            applies.append([v.applicable is not False for v in columns])
            cycling.append(cycled.answer == "yes")
    return np.array(verdicts).T, np.array(applies).T, np.array(cycling)


def rows(grids: dict[str, int], records: Path, labels: Path) -> list[dict[str, object]]:
    """Return one row per variant.

    `records, labels`: folder of real records and the table of their labels; left out where absent.

    Keys: method, variant, fitted on (those of the grids to other loops of which its constants were
    fitted); per grid: right (share of the loops that apply; no decision is wrong), found, false
    alarms, no decision, cost, and the gain of the improved method over this variant with McNemar's
    p; on real units: found, false alarms, undecided, cost, and what the improved method finds more,
    less what it raises more falsely.
    """
    table_rows: list[dict[str, object]] = []
    for m, v, _ in variants():
        home = registry.load(m).METHOD.fitted_on if v not in (PUBLISHED, CHAPTER) else ()
        table_rows.append(
            {"method": m, "variant": v, "fitted on": ", ".join(g for g in grids if g in home)}
        )
    for grid, every in grids.items():
        verdicts, applies, cycling = simulated(grid, every)
        best = 0
        for i, row in enumerate(table_rows):
            best = i if row["variant"] in (IMPROVED, NO_RULE) else best
            row |= _columns(grid, verdicts[i], applies[i], cycling, verdicts[best])
    if labels.exists():
        units = {unit["method"]: unit for unit in _real(records, labels)}
        for i, row in enumerate(table_rows):
            unit = units.get(
                str(i),
                dict.fromkeys(
                    ("found", "n_stiction", "false_alarms", "n_other", "undecided", "cost"), 0
                ),
            )
            best = i if row["variant"] in (IMPROVED, NO_RULE) else best
            mine, other = (
                unit["found"] - unit["false_alarms"],
                units[str(best)]["found"] - units[str(best)]["false_alarms"],
            )
            row["real found"] = f"{unit['found']}/{unit['n_stiction']}"
            row["false"] = f"{unit['false_alarms']}/{unit['n_other']}"
            row["open"], row["real cost"] = str(unit["undecided"]), unit["cost"]
            row["real gain"] = "" if i == best else f"{other - mine:+d}"
    return table_rows


def _answers(record: LoopRecord) -> list[Verdict]:
    """Return the verdict of every variant; as published a method is given the whole record."""
    blind, verdicts = prepare(record.without_mv()), []
    for m, variant, chosen in variants():
        at = registry.load(f"{m}@{PUBLISHED_ID}" if variant == PUBLISHED else m)
        seen = replace(record, meta={}) if at.METHOD.needs_mv else record.without_mv()
        verdicts.append(judge_one(m, at, blind.seen_by(at.METHOD, seen), False, chosen))
    return verdicts


def _real(records: Path, labels: Path) -> list[dict[str, Any]]:
    """Score every variant, by its number, on real units."""
    read = judge_files(records, ["kano_a"], labels=labels).records
    columns = []
    for name, record in read.items():
        columns += [
            (name, verdict.but(method=str(i))) for i, verdict in enumerate(_answers(record))
        ]
    return score_units(columns, read_labels(labels))


def _columns(
    grid: str, verdicts: np.ndarray, applies: np.ndarray, cycling: np.ndarray, best: np.ndarray
) -> dict[str, object]:
    verdicts, best, cycling = verdicts[applies], best[applies], cycling[applies]
    right, other = verdicts == cycling, best == cycling
    lost, won = int((right & ~other).sum()), int((other & ~right).sum())
    gain = f"{other.mean() - right.mean():+.3f} p {mcnemar(lost, won):.2g}" if lost + won else ""
    return {
        grid: f"{right.mean():.3f} of {right.size}",
        f"{grid} found": f"{(verdicts[cycling] == 1).mean():.3f}",
        f"{grid} false": f"{(verdicts[~cycling] == 1).mean():.3f}",
        f"{grid} open": f"{(verdicts == -1).mean():.3f}",
        f"{grid} cost": f"{(verdicts != cycling).mean() - 0.5 * (verdicts == -1).mean():.3f}",
        f"{grid} gain": gain,
    }


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.published --records FOLDER`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.published", description=__doc__
    )
    parser.add_argument(
        "--records",
        type=Path,
        default=Path("../shared/data/real"),
        help="real records with a records.csv",
    )
    parser.add_argument(
        "--every", type=int, default=1, help="every so many-th of the groups looked at by default"
    )
    chosen = parser.parse_args(arguments)
    grids = {grid: every * chosen.every for grid, every in GRIDS.items()}
    looked = ", ".join(f"every {every}th group of {grid}" for grid, every in grids.items())
    print(
        f"{looked}, seeds {' and '.join(map(str, SEEDS))}, truth: cycled, with the oscillation"
        " front end"
    )
    gain = "how much oftener the improved method is right than this variant; McNemar's p"
    print(f"cost: an error 1, no decision .5; gain: {gain}")
    print("\n".join(table(rows(grids, chosen.records, chosen.records / "records.csv"))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))

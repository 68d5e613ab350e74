"""How often is stiction denied where the valve sticks, and is it wider than what is denied?

`python -m results.studies.plant.denials` draws loops of three simulators, records them with 4 to 60
samples a period (the controller goes on between them), and prints what is concluded of sticky and
of sound ones, with and without the rules that friction must have been able to show; and how often
the valve sticks by at least the S that is said to be denied.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

from results.studies.plant.stiction_probability import GRID, entry, member
from results.studies.withheld.files import write_item
from results.studies.worlds import load_world
from simbench.bench.statistics import wilson
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.gap.stiction.deniable import resample_record
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import log_odds, probability, verdict
from simbench.progress import Progress
from simbench.usage import exit_code

SIMULATORS = ("own", "refinery", GRID)
PACES = ((4.0, 10.0), (10.0, 20.0), (20.0, np.inf))  # samples per period
ASKED, WIDER = "asked", "wider"


class Recorded(NamedTuple):
    """A record, the S (%) of its valve, 0 of a sound one, and its samples per period, 0 where it
    does not oscillate.
    """

    record: LoopRecord
    S: float
    pace: float


def recorded(simulator: str, number: int, seed: int) -> Recorded:
    """Return the record of a number, whose valve sticks where the number is odd."""
    rng = np.random.default_rng([seed, SIMULATORS.index(simulator), number])
    if simulator == GRID:
        scenario, run = member(GRID, number, rng)
        record, S = run.record, float(scenario.tags["S"] or 0.0)
    else:
        item = load_world(simulator).draw(seed, number, entry(number))
        S = float(item.answer["parameters"].get("S", 0.0)) if number % 2 else 0.0
        with tempfile.TemporaryDirectory() as place:
            record = read_record(write_item(item, Path(place), "loop")[0])
    record = replace(record, mv=None, meta={})
    swing = find_oscillation(record.op, record.pv, record.Ts)
    if not swing.sustained:
        return Recorded(record, S, 0.0)
    pace = swing.period_s / record.Ts
    k = int(np.clip(round(pace / np.exp(rng.uniform(np.log(4), np.log(60)))), 1, record.n // 120))
    return Recorded(resample_record(record, lambda x: x[::k], k), S, pace / k)


def asked(simulator: str, number: int, seed: int) -> list[tuple[str, str, str, str]]:
    """Return what counts of one loop: truth, simulator, pace and what is said."""
    record, S, pace = recorded(simulator, number, seed)
    where = next((f"{a:g} to {b:g}" for a, b in PACES if a <= pace < b), "no oscillation")
    try:
        weighed = friction(record)
    except UserError:
        return []
    about = ("sticky" if number % 2 else "sound"), simulator, where
    before, after = verdict(probability(log_odds(weighed.evidence))), verdict(weighed.probability)
    said = [ASKED, before + " before", after]
    if after == NO_STICTION and weighed.shown is not None and weighed.shown.S <= S:
        said.append(WIDER)
    return [(*about, what) for what in said]


def main() -> int:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-n", type=int, default=100, help="sticky loops of each simulator [100]")
    parser.add_argument("--sound", type=int, default=30, help="sound loops of each [30]")
    parser.add_argument("--seed", type=int, default=9301, help="seed of the loops [9301]")
    parser.add_argument("-j", type=int, default=2, help="loops at once [2]")
    options = parser.parse_args()
    counts: Counter[tuple[str, str, str, str]] = Counter()
    numbers = [2 * i + 1 for i in range(options.n)] + [2 * i for i in range(options.sound)]
    for simulator in SIMULATORS:
        jobs = (delayed(asked)(simulator, number, options.seed) for number in numbers)
        for said in Progress(
            Parallel(n_jobs=options.j, return_as="generator")(jobs),
            total=len(numbers),
            desc=simulator,
        ):
            counts.update(said)
    for truth in ("sticky", "sound"):
        print(
            f"{truth} valves: stiction denied without the rules, with them, of a valve that sticks"
            " by what is denied, and claimed:"
        )
        for axis in (1, 2):
            for name in dict.fromkeys(key[axis] for key in sorted(counts)):
                print(line(counts, truth, axis, name))
        print(line(counts, truth, 0, truth))
    return 0


def line(counts: Counter[tuple[str, str, str, str]], truth: str, axis: int, name: str) -> str:
    """Return one row of the table."""

    def of(word: str) -> int:
        return sum(
            n for k, n in counts.items() if k[0] == truth and k[axis] == name and k[3] == word
        )

    n, denied = of(ASKED), of(NO_STICTION)
    lo, hi = wilson(denied, n) if n else (0.0, 1.0)
    return (
        f"  {name:<15} n {n:>3}  {of(NO_STICTION + ' before'):>3}  {denied:>3}"
        f" ({lo:.2f} to {hi:.2f})  {of(WIDER):>3}  {of(STICTION):>3}"
    )


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

"""How often is stiction denied where the valve sticks, and does what "would have shown" show?

`python -m results.studies.plant.denials` draws loops of three simulators, records them with 4 to 60
samples a period (the controller goes on between them), and prints what is concluded of sticky and
of sound ones, with and without the rule that friction must have been visible; and of the sizes that
"would have shown", in how many of eight simulations with them stiction is called.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from results.studies.plant.stiction_probability import GRID, entry, member
from results.studies.withheld.files import write_item
from results.studies.worlds import load_world
from simbench.bench.statistics import wilson
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.stiction.altered import with_friction
from simbench.gap.stiction.friction import Friction, friction
from simbench.gap.stiction.measured import resample_record
from simbench.gap.stiction.probability import log_odds, probability, verdict
from simbench.loop.simulate import simulate
from simbench.progress import Progress

SIMULATORS = ("own", "refinery", GRID)
PACES = ((4.0, 10.0), (10.0, 20.0), (20.0, np.inf))  # samples per period
SEEDS = 8  # simulations with the size that would have shown


def recorded(simulator: str, number: int, seed: int) -> tuple[LoopRecord, bool, float]:
    """Return a record, whether its valve sticks, and its samples per period, 0 where it does not
    oscillate.
    """
    rng = np.random.default_rng([seed, SIMULATORS.index(simulator), number])
    if simulator == GRID:
        _, run = member(GRID, number, rng)
        record = run.record
    else:
        item = load_world(simulator).draw(seed, number, entry(number))
        with tempfile.TemporaryDirectory() as place:
            record = read_record(write_item(item, Path(place), "loop")[0])
    record, sticky = replace(record, mv=None, meta={}), number % 2 == 1
    swing = find_oscillation(record.op, record.pv, record.Ts)
    if not swing.sustained:
        return record, sticky, 0.0
    pace = swing.period_s / record.Ts
    k = int(np.clip(round(pace / np.exp(rng.uniform(np.log(4), np.log(60)))), 1, record.n // 120))
    return resample_record(record, lambda x: x[::k], k), sticky, pace / k


def called(weighed: Friction) -> int:
    """Return in how many simulations of the fitted loop the smallest visible friction is called."""
    s, S = weighed.assessment.situation, weighed.shown.S
    loop = with_friction(ClosedLoops(weighed.assessment, 0).loop([]), S, 0.5 * S)
    count = 0
    for seed in range(100, 100 + SEEDS):
        try:
            run = simulate(loop, seed, kick=S).record
            op, pv = as_archived(s, run.op, run.pv)
            count += verdict(friction(replace(s.record, op=op, pv=pv)).probability) == "stiction"
        except UserError:
            continue
    return count


def main() -> int:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-n", type=int, default=100, help="sticky loops of each simulator [100]")
    parser.add_argument("--sound", type=int, default=30, help="sound loops of each [30]")
    parser.add_argument("--seed", type=int, default=9301, help="seed of the loops [9301]")
    options = parser.parse_args()
    counts: Counter[tuple[str, str, str]] = Counter()
    shown: list[int] = []
    numbers = [2 * i + 1 for i in range(options.n)] + [2 * i for i in range(options.sound)]
    for simulator in SIMULATORS:
        for number in Progress(numbers, desc=simulator):
            record, sticky, pace = recorded(simulator, number, options.seed)
            where = next((f"{a:g} to {b:g}" for a, b in PACES if a <= pace < b), "no oscillation")
            try:
                weighed = friction(record)
            except UserError:
                continue
            about = ("sticky" if sticky else "sound"), simulator, where
            before = verdict(probability(log_odds(weighed.evidence)))
            after = verdict(weighed.probability)
            counts[(*about, "asked")] += 1
            counts[(*about, before + " before")] += 1
            counts[(*about, after)] += 1
            if after == "no_stiction" and not sticky and len(shown) < 40:
                shown.append(called(weighed))
    for truth in ("sticky", "sound"):
        print(f"{truth} valves, stiction denied without the rule, with it, claimed:")
        for axis in (1, 2):
            for name in dict.fromkeys(key[axis] for key in sorted(counts)):
                print(line(counts, truth, axis, name))
        print(line(counts, truth, 0, truth))
    good = sum(n >= 0.75 * SEEDS for n in shown)
    print(
        f"sizes that would have shown: called in three quarters of {SEEDS} simulations of {good} of"
        f" {len(shown)} loops; of all simulations {np.mean(shown) / SEEDS:.2f}"
    )
    return 0


def line(counts: Counter[tuple[str, str, str]], truth: str, axis: int, name: str) -> str:
    """Return one row of the table."""

    def of(word: str) -> int:
        return sum(
            n for k, n in counts.items() if k[0] == truth and k[axis] == name and k[3] == word
        )

    n, denied = of("asked"), of("no_stiction")
    lo, hi = wilson(denied, n) if n else (0.0, 1.0)
    return (
        f"  {name:<15} n {n:>3}  {of('no_stiction before'):>3}  {denied:>3} ({lo:.2f} to {hi:.2f})"
        f"  {of('stiction'):>3}"
    )


if __name__ == "__main__":
    raise SystemExit(main())

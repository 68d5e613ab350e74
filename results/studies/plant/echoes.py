"""Does the conclusion tell a valve that sticks from a load that swings?
`python -m results.studies.plant.echoes ci plant --seed 9175` asks of pairs of loops: one whose
valve sticks, and its echo, a healthy loop that the same motion drives without the valve's corners.

Both oscillate and neither shows its valve's position. The kinds of echo are counted apart: corners
taken off (smooth), a load of a few harmonics, and what another valve's cycle propagates.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed

from results.studies.plant.real_loops import share
from results.studies.plant.stiction_probability import scores
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import YES, simulate_with_truth
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.verdict import STICTION
from simbench.gap.diagnosis import conclude
from simbench.gap.stiction.probability import verdict
from simbench.gap.thresholds import LIKELIER
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid import load_grid
from simbench.scenarios.packaged import grid_names
from simbench.usage import exit_code

FALSE = 0.05  # share of the echoes that may be taken for sticky where the sensitivity is read off
STICKY = "sticky"


class Member(NamedTuple):
    """One loop of a pair: `kind` is that of the echo, or `sticky`."""

    record: LoopRecord
    kind: str


class Asked(NamedTuple):
    """What the product says of one loop: None where it cannot be judged."""

    kind: str
    probability: float | None


def pairs(grid: str, count: int, seed: int) -> Iterator[Member]:
    """Yield both members of so many pairs, each from another group of the grid, drawn by the
    seed.
    """
    source, rng = load_grid(grid), np.random.default_rng(seed)
    groups = (int(index) for index in rng.permutation(source.group_count))
    found = (two for group in groups if (two := _pair(source, group, rng)))
    return chain.from_iterable(islice(found, count))


def _pair(grid: Grid, group: int, rng: np.random.Generator) -> tuple[Member, Member] | None:
    """Return a sticky loop of a group and an echo, drawn from those that are ranked; None where
    there are none, or one of both does not oscillate.
    """
    ranked = [s for s in resolve(grid.group(group)) if s.tags.get("ranked")]
    stuck = [s for s in ranked if str(s.tags["member"]).startswith(STICKY)]
    echoes = [s for s in ranked if s.tags.get("echo", "none") != "none"]
    if not stuck or not echoes:
        return None
    one, other = (members[int(rng.integers(len(members)))] for members in (stuck, echoes))
    (sticking, cycled), (healthy, _) = (simulate_with_truth(s.loop, s.seed) for s in (one, other))
    if cycled.answer != YES or not all(oscillates(r.record) for r in (sticking, healthy)):
        return None
    echo = str(other.tags["echo"])
    return Member(as_seen(sticking.record), STICKY), Member(as_seen(healthy.record), echo)


def oscillates(record: LoopRecord) -> bool:
    """Whether a record's oscillation is sustained."""
    return find_oscillation(record.op, record.pv, record.Ts).sustained


def as_seen(record: LoopRecord) -> LoopRecord:
    """Return what a plant would record: no position of the valve."""
    return replace(record, mv=None, meta={})


def asked(member: Member) -> Asked:
    """Return what the product says of a loop."""
    warnings.simplefilter("ignore")
    return Asked(member.kind, conclude(member.record).probability)


def as_lines(grid: str, answers: Sequence[Asked]) -> list[str]:
    """Return how well sticky loops and echoes are told apart: a loop that cannot be judged has even
    odds.
    """
    sticky = np.array([a.kind == STICKY for a in answers])
    p = np.array([LIKELIER if a.probability is None else a.probability for a in answers])
    _, auc, error = scores(p, sticky)
    found = p[sticky] > np.quantile(p[~sticky], 1.0 - FALSE)
    refused = sum(a.probability is None for a in answers)
    lines = [
        f"{grid}: {sticky.sum()} pairs; loops that cannot be judged, with even odds: {refused}",
        f"  AUC {auc:.3f}; {found.mean():.2f} of the sticky loops found where"
        f" {FALSE:.0%} of the echoes are; calibration error {error:.3f}",
    ]
    for kind in (STICKY, *sorted({a.kind for a in answers} - {STICKY})):
        here = [x for x, a in zip(p, answers) if a.kind == kind]
        claimed = sum(verdict(x) == STICTION for x in here)
        name = "stiction claimed, sticky" if kind == STICKY else f"stiction claimed, echo, {kind}"
        lines.append(f"  {name}: {share(claimed, len(here))}")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Ask of the pairs of every grid and print what was found."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.echoes", description=__doc__
    )
    parser.add_argument("grid", nargs="+", choices=grid_names())
    parser.add_argument("-n", type=int, default=200, help="Pairs of each grid [200].")
    parser.add_argument("--seed", type=int, required=True, help="Seed that draws the pairs.")
    parser.add_argument("-j", type=int, default=2, metavar="JOBS", help="Loops at once [2].")
    given = parser.parse_args(arguments)
    if given.n < 1:
        raise ParameterError(f"-n {given.n}: at least 1 pair is needed")
    for grid in given.grid:
        members = pairs(grid, given.n, given.seed)
        answers = Parallel(n_jobs=given.j)(delayed(asked)(member) for member in members)
        if not answers:
            raise ParameterError(
                f"grid {grid}: no group has a sticky loop and an echo that both oscillate"
            )
        print("\n".join(as_lines(grid, answers)), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

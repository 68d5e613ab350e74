"""Does the conclusion tell a valve that sticks from a load that swings?
`python -m results.studies.plant.echoes ci plant --seed 9175` asks of pairs of loops: one whose
valve sticks, and its echo, a healthy loop that the same motion drives without the valve's corners.

Both oscillate and neither shows its valve's position. The kinds of echo are counted apart: corners
taken off (smooth), a load of a few harmonics, and what another valve's cycle propagates.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any, NamedTuple

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
from simbench.scenarios.spec import Scenario
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


class Study(NamedTuple):
    """What is asked of loops that are drawn from groups of grids."""

    name: str  # of its module
    about: str | None
    of_group: Callable[[Grid, int, np.random.Generator], Sequence[Member]]  # none where not fit
    as_lines: Callable[[str, Sequence[Asked]], list[str]]
    unit: str  # what a group yields
    count: int  # of these, unless another is asked for
    needs: str  # what no group of a grid without any has


def pairs(grid: str, count: int, seed: int) -> Iterator[Member]:
    """Yield both members of so many pairs, each from another group of the grid, drawn by the
    seed.
    """
    return draw_members(STUDY, grid, count, seed)


def draw_members(study: Study, grid: str, count: int, seed: int) -> Iterator[Member]:
    """Yield what a study takes from so many groups of a grid, drawn by the seed."""
    source, rng = load_grid(grid), np.random.default_rng(seed)
    groups = (int(index) for index in rng.permutation(source.group_count))
    found = (members for group in groups if (members := study.of_group(source, group, rng)))
    return chain.from_iterable(islice(found, count))


def ranked_loops(grid: Grid, group: int) -> tuple[list[Scenario], list[Scenario]]:
    """Return the sticky loops of a group and its echoes, of those that are ranked."""
    ranked = [s for s in resolve(grid.group(group)) if s.tags.get("ranked")]
    stuck = [s for s in ranked if str(s.tags["member"]).startswith(STICKY)]
    return stuck, [s for s in ranked if s.tags.get("echo", "none") != "none"]


def _pair(grid: Grid, group: int, rng: np.random.Generator) -> Sequence[Member]:
    """Return a sticky loop of a group and an echo, drawn from those that are ranked; nothing where
    there are none, or one of both does not oscillate.
    """
    stuck, echoes = ranked_loops(grid, group)
    if not stuck or not echoes:
        return ()
    one, other = (members[int(rng.integers(len(members)))] for members in (stuck, echoes))
    (sticking, cycled), (healthy, _) = (simulate_with_truth(s.loop, s.seed) for s in (one, other))
    if cycled.answer != YES or not all(oscillates(r.record) for r in (sticking, healthy)):
        return ()
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


STUDY = Study(
    name="echoes",
    about=__doc__,
    of_group=_pair,
    as_lines=as_lines,
    unit="pair",
    count=200,
    needs="a sticky loop and an echo that both oscillate",
)


def ask_grids(study: Study, arguments: list[str] | None) -> int:
    """Ask of what a study takes from every grid and print what was found."""
    parser = argparse.ArgumentParser(
        prog=f"python -m results.studies.plant.{study.name}", description=study.about
    )
    units, count = f"{study.unit}s", study.count
    parser.add_argument("grid", nargs="+", choices=grid_names())
    parser.add_argument(
        "-n", type=int, default=count, help=f"{units.capitalize()} of each grid [{count}]."
    )
    parser.add_argument("--seed", type=int, required=True, help=f"Seed that draws the {units}.")
    parser.add_argument("-j", type=int, default=2, metavar="JOBS", help="Loops at once [2].")
    given = parser.parse_args(arguments)
    if given.n < 1:
        raise ParameterError(f"-n {given.n}: at least 1 {study.unit} is needed")
    for grid in given.grid:
        members = draw_members(study, grid, given.n, given.seed)
        answers: Any = Parallel(n_jobs=given.j)(delayed(asked)(member) for member in members)
        if not answers:
            raise ParameterError(f"grid {grid}: no group has {study.needs}")
        print("\n".join(study.as_lines(grid, answers)), flush=True)
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Ask of the pairs of every grid and print what was found."""
    return ask_grids(STUDY, arguments)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))

"""Measure how a grid's records differ from recorded ones: how far, where, which effect, and how far
it shrinks once that effect is added (`simbench gap grid`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from joblib import delayed

from simbench.bench.execute.run import read_plan
from simbench.bench.execute.run_options import RunOptions
from simbench.bench.statistics import Estimate
from simbench.detectors.errors import ParameterError, RecordError, nearest
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.detectors.report.report import choose_methods
from simbench.gap.benchmark.classifier import FeatureSample, auc_of_few, tell_apart
from simbench.gap.benchmark.draw import (
    Chosen,
    DrawnLoop,
    accuracy_on,
    draw_loops,
    sample_of,
    with_nuisances,
)
from simbench.gap.benchmark.features import BLOCKS
from simbench.gap.benchmark.nuisances import ADDITIONS, STRENGTHS
from simbench.gap.benchmark.result import GridGap, MethodAccuracy, TriedAddition
from simbench.parallel import run_parallel
from simbench.scenarios.expansion import Grid

LOOPS = 130  # drawn from the grid where no other number is asked for
_FEWEST = 10  # records, and loops that a nuisance leaves, for a classifier
_SUITED = 0.5  # of the loops; what suits fewer, or lets more run away, is no answer for the grid
# by which a nuisance must bring down the mean of the AUC and those of the blocks to be added
_WORTH = 0.01
_MOST_ADDED = 5
_MOST_TOLD = 8  # nuisances whose cost to each detector is told


def grid(
    grid: str | Path | Grid,
    records: str | Path | Mapping[str, LoopRecord],
    *,
    methods: Sequence[str] = ("fast",),
    units: Mapping[str, str] | None = None,
    additions: Sequence[str] | None = None,
    n: int = LOOPS,
    seed: int = 0,
    jobs: int = 1,
    **about: Any,
) -> GridGap:
    """Say how well a grid's records can be told from recorded ones, by what, which effects the grid
    lacks, and how far adding them brings both together.

    Parameters
    ----------
    grid : str, Path or Grid
        Name of a grid, a TOML file, or the folder of a run.
    records : str, Path, or mapping of str to LoopRecord
        Folder of records, or records by their names.
    methods : sequence of str
        Detectors whose accuracy is compared, ids or groups; empty for none.
    units : mapping of str to str, optional
        Unit (a vessel, a column, one loop recorded several times) of a record by its name: a
        classifier that has learned a record of a unit is not asked about another of it. A record
        that is not named is a unit by itself.
    additions : sequence of str, optional
        Names of the effects and nuisances that are tried, those of `ADDITIONS`; None tries all.
    n : int
        Loops that are drawn from the grid.
    seed : int
        Root of every random stream.
    jobs : int
        Worker processes; -1 uses all cores.
    **about
        What is known of the records, as in `read_record`.

    Returns
    -------
    GridGap
        AUC of "recorded or simulated?" with its interval, by block, and with nuisances added.

    Raises
    ------
    simbench.detectors.errors.UserError
        For an unknown grid, method or addition, or fewer than 10 records.

    Notes
    -----
    An AUC of .5 says that these features tell nothing, not that a ranking of methods on the grid
    holds on the records: `results/agreement.txt` measures that.

    Examples
    --------
    >>> from simbench.loop.simulate import simulate
    >>> from simbench.gap.benchmark.draw import draw_loops
    >>> from simbench.scenarios.settled import settled_grid
    >>> drawn = draw_loops(settled_grid("smoke"), 12, seed=1)
    >>> records = {str(k): one.record for k, one in enumerate(drawn)}
    >>> found = grid("smoke", records, n=12, methods=(), additions=["outliers"])
    >>> found.auc.lo <= found.auc.value <= found.auc.hi
    True
    """
    if n < _FEWEST:
        raise ParameterError(f"gap grid: n = {n} loops; at least {_FEWEST} are needed")
    for name in additions or ():
        if name not in ADDITIONS:
            raise ParameterError(f"gap grid: addition {name!r}: {nearest(name, ADDITIONS)}")
    asked = choose_methods(methods) if methods else []
    plan = read_plan(grid, RunOptions())
    named, refused = (
        (records, {}) if isinstance(records, Mapping) else read_folder(records, **about)
    )
    if len(named) < _FEWEST:
        why = "; ".join(f"{name}: {reason}" for name, reason in list(refused.items())[:3])
        raise RecordError(
            f"gap grid: {len(named)} records; at least {_FEWEST} are needed"
            + (f" ({why})" if why else "")
        )
    lent = list(named.values())
    recorded = sample_of(lent, [(units or {}).get(name, name) for name in named])
    drawn = [
        replace(one, unit=(units or {}).get(one.unit, one.unit))
        for one in draw_loops(plan, n, seed)
    ]
    if len(drawn) < _FEWEST:
        raise ParameterError(
            f"gap grid: {plan.name} has {len(drawn)} loops that can be simulated; at least"
            f" {_FEWEST} are needed"
        )
    search = Search(drawn, lent, recorded, seed, jobs)
    before = search.asked([()])[0]
    tried = [one for one in _every() if additions is None or one[0] in additions]
    singles = search.asked([(one,) for one in tried])
    together = search.combined(before, singles)
    helpful = _best_of_each(before, singles)
    accuracy = _accuracies(search, asked, [before, *helpful[:_MOST_TOLD], *together[-1:]])
    return GridGap(
        grid=plan.benchmark,
        loops=len(drawn),
        records=len(lent),
        units=len(set(recorded.units)),
        before=before,
        singles=tuple(helpful),
        together=tuple(together),
        accuracy=accuracy,
        refused=refused,
    )


def _every() -> list[Chosen]:
    return [
        (name, strength)
        for name, one in ADDITIONS.items()
        for strength in (STRENGTHS if one.sized else (1.0,))
    ]


class Search:
    """What every question has in common: the loops, the records, and who works."""

    def __init__(
        self,
        drawn: list[DrawnLoop],
        lent: list[LoopRecord],
        recorded: FeatureSample,
        seed: int,
        jobs: int,
    ) -> None:
        self.drawn = drawn
        self.lent = lent
        self.recorded = recorded
        self.seed = seed
        self.jobs = jobs

    def asked(self, several: Sequence[tuple[Chosen, ...]]) -> list[TriedAddition]:
        """Return how well the loops with some nuisances can be told from the records."""
        calls = [
            delayed(_tell_apart)(self.drawn, chosen, self.lent, self.recorded, self.seed)
            for chosen in several
        ]
        return run_parallel(calls, self.jobs, "nuisances")

    def combined(
        self, before: TriedAddition, singles: Sequence[TriedAddition]
    ) -> list[TriedAddition]:
        """Return what is added one after the other: each time what brings the loops nearest to the
        records, as long as that is worth it.
        """
        steps = []
        now = before
        rest = _best_of_blocks(_best_of_each(before, singles))
        while rest and len(steps) < _MOST_ADDED:
            tried = self.asked([(*now.chosen, *one.chosen) for one in rest]) if steps else rest
            best = min(tried, key=lambda one: one.distance)
            if best.distance > now.distance - _WORTH:
                break
            steps.append(best)
            now = best
            added = {name for name, _ in now.chosen}
            rest = [one for one in rest if one.chosen[0][0] not in added]
        return steps


def _best_of_each(before: TriedAddition, singles: Sequence[TriedAddition]) -> list[TriedAddition]:
    """Return each nuisance in its best strength where it brings the loops nearer, the best
    first.
    """
    best: dict[str, TriedAddition] = {}
    for one in singles:
        name = one.chosen[0][0]
        if name not in best or one.distance < best[name].distance:
            best[name] = one
    helpful = [one for one in best.values() if one.distance < before.distance - _WORTH]
    return sorted(helpful, key=lambda one: one.distance)


def _best_of_blocks(helpful: Sequence[TriedAddition]) -> list[TriedAddition]:
    """Return the best nuisance of each block."""
    best: dict[str, TriedAddition] = {}
    for one in helpful:
        best.setdefault(ADDITIONS[one.chosen[0][0]].block, one)
    return list(best.values())


def _tell_apart(
    drawn: Sequence[DrawnLoop],
    chosen: tuple[Chosen, ...],
    lent: Sequence[LoopRecord],
    recorded: FeatureSample,
    seed: int,
) -> TriedAddition:
    """Return how well loops with nuisances are told from records: by all features, and by those of
    each block.
    """
    changed = with_nuisances(drawn, chosen, lent, seed)
    if len(changed) < max(_FEWEST, _SUITED * len(drawn)):
        return TriedAddition(
            chosen, Estimate(1.0, 0.0, 1.0), dict.fromkeys(BLOCKS, 1.0), len(changed)
        )
    simulated = sample_of([one.record for one in changed], [one.unit for one in changed])
    by_block = {b: auc_of_few(simulated.of(b), recorded.of(b), seed) for b in BLOCKS}
    return TriedAddition(chosen, tell_apart(simulated, recorded, seed), by_block, len(changed))


def _accuracies(
    search: Search, methods: Sequence[str], several: Sequence[TriedAddition]
) -> dict[tuple[Chosen, ...], MethodAccuracy]:
    """Return how right methods are on the loops with each of some sets of nuisances."""
    if not methods:
        return {}
    sets = list(dict.fromkeys(one.chosen for one in several))
    calls = [
        delayed(_accuracy)(search.drawn, chosen, search.lent, search.seed, methods)
        for chosen in sets
    ]
    return dict(zip(sets, run_parallel(calls, search.jobs, "detectors"), strict=True))


def _accuracy(
    drawn: Sequence[DrawnLoop],
    chosen: tuple[Chosen, ...],
    lent: Sequence[LoopRecord],
    seed: int,
    methods: Sequence[str],
) -> MethodAccuracy:
    return accuracy_on(with_nuisances(drawn, chosen, lent, seed), methods)

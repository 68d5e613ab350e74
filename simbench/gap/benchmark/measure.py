"""Measure how a grid's records differ from recorded ones: how far, which effect, and how far it
shrinks once that effect is added (`simbench gap grid`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from joblib import delayed

from simbench.bench.execute.run import read_plan
from simbench.bench.scenario.resolve import resolve
from simbench.bench.statistics import Estimate, auc
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError, RecordError, UserError, nearest
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.gap.benchmark.nuisances import ADDITIONS, STRENGTHS, Source
from simbench.gap.benchmark.result import GridGap, TriedAddition
from simbench.gap.closed_loop.gap import features
from simbench.loop.simulate import simulate
from simbench.parallel import run_parallel
from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid
from simbench.scenarios.spec import Loop

# --- Draw loops from a grid, simulate them as they are or with something added, and describe
# records by features that have no unit.

_SMALLEST = 1e-12
# a nuisance by its name, and its strength
Chosen = tuple[str, float]


@dataclass(frozen=True, eq=False)
class DrawnLoop:
    """A loop of a grid with its seed and its unit, and its record as it is."""

    loop: Loop
    seed: int
    unit: str
    record: LoopRecord


def draw_loops(grid: Grid, n: int, seed: int) -> list[DrawnLoop]:
    """Return about `n` loops of a grid, those that it ranks, as many of each group; fewer where it
    has no more. A loop that copies a record is of the unit of that record.
    """
    # Groups in an order that is drawn, and how many loops each gives
    rng = np.random.default_rng([seed, 1])
    order = []
    for k in rng.permutation(grid.group_count).tolist():
        if grid.size(k):
            order.append(k)
    each = -(-n // max(len(order), 1))
    drawn: list[DrawnLoop] = []
    for index in order:
        if len(drawn) >= n:
            break

        # some of the group's loops that are ranked; what cannot be simulated is passed over
        ranked = []
        for s in resolve(grid.group(index)):
            if s.tags.get("ranked", 1.0) != 0.0:
                ranked.append(s)
        for k in rng.permutation(len(ranked))[:each].tolist():
            one = ranked[k]
            unit = str(one.tags.get("record", f"group {index}"))
            try:
                record = simulate(one.loop, one.seed).record
            except UserError:
                continue
            drawn.append(DrawnLoop(one.loop, one.seed, unit, record))
    return drawn


def with_nuisances(
    drawn: Sequence[DrawnLoop], chosen: Sequence[Chosen], lent: Sequence[LoopRecord], seed: int
) -> list[DrawnLoop]:
    """Return loops with nuisances in them, one after the other, and their records; those that run
    away with them are left out.
    """
    found = []
    for number, one in enumerate(drawn):
        loop = one.loop
        record = one.record
        try:
            for name, strength in chosen:
                # by its name: one nuisance more must not shift the draws of the others
                rng = np.random.default_rng([seed, 2, number, crc32(name.encode())])
                source = Source(rng, lent[int(rng.integers(len(lent)))])
                loop = ADDITIONS[name].add(loop, one.record, source, strength)
            if chosen:
                record = simulate(loop, one.seed).record
        # a plant in powers of z has one sampling period alone
        except (UserError, SpecError):
            continue
        if np.isfinite(record.pv).all():
            found.append(DrawnLoop(loop, one.seed, one.unit, record))
    return found


def describe(records: Sequence[LoopRecord]) -> np.ndarray:
    """Return the features of records, shape (records, features): those of the diagnosis, of OP and
    of the error in units of their standard deviations.
    """
    rows = []
    with one_thread():
        for record in records:
            op = np.asarray(record.op, float)
            pv = np.asarray(record.pv, float)
            error = pv - (pv.mean() if record.sp is None else np.asarray(record.sp, float))
            op = (op - op.mean()) / (np.std(op) + _SMALLEST)
            error = (error - error.mean()) / (np.std(error) + _SMALLEST)
            rows.append(list(features(op, error, np.zeros(record.n)).values()))
    return np.nan_to_num(np.array(rows, dtype=float))


LOOPS = 130  # drawn from the grid where no other number is asked for
_FEWEST = 10  # records, and loops that a nuisance leaves, for a classifier
_SUITED = 0.5  # of the loops; what suits fewer, or lets more run away, is no answer for the grid
_WORTH = 0.01  # by which a nuisance must make the classifier less certain to be added


def grid(
    grid: str | Path | Grid,
    records: str | Path | Mapping[str, LoopRecord],
    *,
    units: Mapping[str, str] | None = None,
    additions: Sequence[str] | None = None,
    n: int = LOOPS,
    seed: int = 0,
    jobs: int = 1,
    **about: Any,
) -> GridGap:
    """Say how well a grid's records can be told from recorded ones, which effects the grid lacks,
    and how far adding them brings both together.

    Parameters
    ----------
    grid : str, Path or Grid
        Name of a grid, a TOML file, or the folder of a run.
    records : str, Path, or mapping of str to LoopRecord
        Folder of records, or records by their names.
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
        AUC of "recorded or simulated?" with its interval, and with nuisances added.

    Raises
    ------
    simbench.detectors.errors.UserError
        For an unknown grid or addition, or fewer than 10 records.

    Notes
    -----
    An AUC of .5 says that these features tell nothing, not that a ranking of methods on the grid
    holds on the records: `results/agreement.txt` measures that.

    Examples
    --------
    >>> from simbench.gap.benchmark.measure import draw_loops
    >>> from simbench.scenarios.settled import settled_grid
    >>> drawn = draw_loops(settled_grid("smoke"), 12, seed=1)
    >>> records = {str(k): one.record for k, one in enumerate(drawn)}
    >>> found = grid("smoke", records, n=12, additions=["outliers"])
    >>> found.auc.lo <= found.auc.value <= found.auc.hi
    True
    """
    # the grid, the records, and what is to be tried
    if n < _FEWEST:
        raise ParameterError(f"gap grid: n = {n} loops; at least {_FEWEST} are needed")
    for name in additions or ():
        if name not in ADDITIONS:
            raise ParameterError(f"gap grid: addition {name!r}: {nearest(name, ADDITIONS)}")
    plan = read_plan(grid, {})
    if isinstance(records, Mapping):
        named = records
        refused = {}
    else:
        named, refused = read_folder(records, **about)
    if len(named) < _FEWEST:
        raise RecordError(
            f"gap grid: {len(named)} records, and {len(refused)} files that are none; at least"
            f" {_FEWEST} records are needed"
        )
    drawn = draw_loops(plan, n, seed)
    if len(drawn) < _FEWEST:
        raise ParameterError(
            f"gap grid: {plan.name} has {len(drawn)} loops that can be simulated; at least"
            f" {_FEWEST} are needed"
        )

    # how far the grid is as it is, with each addition in its best strength, and with several
    search = Search(drawn, named, units or {}, seed, jobs)
    before = search.ask([()])[0]
    tried = []
    for name, one in ADDITIONS.items():
        if additions is None or name in additions:
            for strength in STRENGTHS if one.sized else (1.0,):
                tried.append((name, strength))
    singles = _best_of_each(before, search.ask([(one,) for one in tried]))
    together = search.combine(before, singles)

    # The grid as it is, and what brings it nearer
    return GridGap(
        grid=plan.benchmark,
        loops=len(drawn),
        records=len(named),
        units=len({search.unit(name) for name in named}),
        before=before,
        singles=tuple(singles),
        together=tuple(together),
        block=ADDITIONS[together[0].chosen[0][0]].block if together else "none",
        refused=refused,
    )


@dataclass(frozen=True)
class Search:
    """What every question has in common: the loops, the records with their units, and who works."""

    drawn: Sequence[DrawnLoop]
    records: Mapping[str, LoopRecord]
    units: Mapping[str, str]
    seed: int
    jobs: int

    def unit(self, name: str) -> str:
        """Return the unit of a record, or of a loop that copies one."""
        return self.units.get(name, name)

    @cached_property
    def recorded(self) -> np.ndarray:
        """The features of the records."""
        return describe(list(self.records.values()))

    def ask(self, several: Sequence[tuple[Chosen, ...]]) -> list[TriedAddition]:
        """Return how well the loops with some nuisances can be told from the records."""
        calls = [delayed(_try_addition)(self, self.recorded, chosen) for chosen in several]
        return run_parallel(calls, self.jobs, "nuisances")

    def combine(
        self, before: TriedAddition, singles: Sequence[TriedAddition]
    ) -> list[TriedAddition]:
        """Return what is added one after the other, the best of each block, as long as it brings
        the loops nearer to the records.
        """
        best: dict[str, Chosen] = {}
        for one in singles:
            best.setdefault(ADDITIONS[one.chosen[0][0]].block, one.chosen[0])
        steps = [before]
        for chosen in best.values():
            (tried,) = self.ask([(steps[-1].chosen + (chosen,))])
            if tried.certain < steps[-1].certain - _WORTH:
                steps.append(tried)
        return steps[1:]


def _try_addition(
    search: Search, recorded: np.ndarray, chosen: tuple[Chosen, ...]
) -> TriedAddition:
    """Return how well loops with nuisances are told from records."""
    changed = with_nuisances(search.drawn, chosen, list(search.records.values()), search.seed)
    if len(changed) < max(_FEWEST, _SUITED * len(search.drawn)):
        return TriedAddition(chosen, Estimate(1.0, 0.0, 1.0), 1.0, len(changed))
    simulated = describe([one.record for one in changed])
    units = [search.unit(name) for name in (*(one.unit for one in changed), *search.records)]
    area, certain = tell_apart(simulated, recorded, units, search.seed)
    return TriedAddition(chosen, area, certain, len(changed))


def _best_of_each(before: TriedAddition, singles: Sequence[TriedAddition]) -> list[TriedAddition]:
    """Return each nuisance in its best strength where it brings the loops nearer, the best
    first.
    """
    best: dict[str, TriedAddition] = {}
    for one in sorted(singles, key=lambda one: one.certain):
        if one.certain < before.certain - _WORTH:
            best.setdefault(one.chosen[0][0], one)
    return list(best.values())


# --- How well can a classifier tell recorded loops from simulated ones? The area under its ROC
# curve is a distance between two sets of records: .5 where they cannot be told apart, 1 where any
# can.
#
# Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR; extremely randomised
# trees by Geurts, Ernst and Wehenkel (2006), Machine Learning 63, 3.

_FOLDS = 5  # in which whole units are left out
_TREES = 60
_LEAF = 2  # records in a leaf


def tell_apart(
    simulated: np.ndarray,
    recorded: np.ndarray,
    units: Sequence[str],
    seed: int = 0,
) -> tuple[Estimate, float]:
    """Return the AUC with which records are told from simulated ones by their features, shape
    (records, features) each, and the mean probability that the classifier gives to what is true.

    `units`, of the simulated ones first: a record is asked about by what was learned on others.
    """
    # here, for it takes a second to load
    from sklearn.ensemble import ExtraTreesClassifier
    from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict

    features = np.concatenate([simulated, recorded])
    label = np.repeat([False, True], [len(simulated), len(recorded)])
    model = ExtraTreesClassifier(
        _TREES, min_samples_leaf=_LEAF, class_weight="balanced", random_state=seed
    )
    folds = StratifiedGroupKFold(_FOLDS, shuffle=True, random_state=seed)
    with one_thread():
        p = cross_val_predict(
            model, features, label, groups=units, cv=folds, method="predict_proba"
        )[:, 1]

    # both kinds count as much
    certain = 0.5 * (p[label].mean() + 1.0 - p[~label].mean())
    return auc(p, label), float(certain)

"""Draw loops from a grid, simulate them as they are or with something added, and describe records
by features that have no unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark.nuisances import ADDITIONS, Source
from simbench.gap.closed_loop.summary_features import features
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid
from simbench.scenarios.spec import Loop

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

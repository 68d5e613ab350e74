"""Draw loops from a grid, and simulate them as they are or with nuisances: their records' features,
what they are labelled, and what detectors say of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import NO, YES, simulate_with_truth
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.gap.benchmark.classifier import FeatureSample
from simbench.gap.benchmark.features import describe
from simbench.gap.benchmark.nuisances import ADDITIONS, Source
from simbench.gap.benchmark.result import MethodAccuracy
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid
from simbench.scenarios.spec import Loop


@dataclass(frozen=True, eq=False)
class DrawnLoop:
    """A loop of a grid with its seed and its unit, and its record as it is."""

    loop: Loop
    seed: int
    unit: str
    record: LoopRecord


# a nuisance by its name, and its strength
Chosen = tuple[str, float]


def draw_loops(grid: Grid, n: int, seed: int) -> list[DrawnLoop]:
    """Return about `n` loops of a grid, those that it ranks, as many of each group; fewer where it
    has no more. A loop that copies a record is of the unit of that record.
    """
    rng = np.random.default_rng([seed, 1])
    order = [k for k in rng.permutation(grid.group_count).tolist() if grid.size(k)]
    each = -(-n // max(len(order), 1))
    drawn: list[DrawnLoop] = []
    for index in order:
        if len(drawn) >= n:
            break
        ranked = [s for s in resolve(grid.group(index)) if s.tags.get("ranked", 1.0) != 0.0]
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
        if np.isfinite(record.pv).all() and np.ptp(record.op) > 0.0 and np.ptp(record.pv) > 0.0:
            found.append(DrawnLoop(loop, one.seed, one.unit, record))
    return found


def sample_of(records: Sequence[LoopRecord], units: Sequence[str]) -> FeatureSample:
    """Return records by their features."""
    with one_thread():
        rows = [describe(record) for record in records]
    blocks = tuple(block for block, _ in rows[0])
    return FeatureSample(np.array([list(row.values()) for row in rows]), tuple(units), blocks)


def accuracy_on(drawn: Sequence[DrawnLoop], methods: Sequence[str]) -> MethodAccuracy:
    """Return how right methods are on loops that cycle because of their valve and on those that do
    not; others are not counted.
    """
    kinds = []
    said = []
    with one_thread():
        for one in drawn:
            try:
                run, cycled = simulate_with_truth(one.loop, one.seed)
            except UserError:
                continue
            if cycled.answer in (YES, NO):
                kinds.append(cycled.answer == YES)
                said.append([v.verdict for v in judge(run.record.without_mv(), methods)])
    sticky = np.array(kinds, dtype=bool)
    right: dict[str, float | None] = dict.fromkeys(methods)
    if 0 < sticky.sum() < sticky.size:
        credit = np.array(
            [
                [0.5 if v == NO_DECISION else float((v == STICTION) == kind) for v in row]
                for row, kind in zip(said, kinds, strict=True)
            ]
        )
        means = 0.5 * (credit[sticky].mean(axis=0) + credit[~sticky].mean(axis=0))
        right = dict(zip(methods, means.tolist(), strict=True))
    return MethodAccuracy(right, int(sticky.sum()), int((~sticky).sum()))

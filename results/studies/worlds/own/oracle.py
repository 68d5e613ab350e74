"""Compute what only the simulator can know: how visible a fault is, and how far the gap shrinks
when the fault is added.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from results.studies.withheld.distance import RESOLVABLE, Cloud, cloud, features
from results.studies.worlds.own.loops import Fault, Signals, TrueLoop, simulate
from results.studies.worlds.own.sizes import Habit

STRENGTHS: dict[str, tuple[float, float]] = {
    "weak": (1.3, 2.0),
    "medium": (2.0, 4.0),
    "strong": (4.0, 12.0),
}
"""Ratio gap(true loop without the fault) / floor.

Strong has no upper end by definition; the generator stops at 12.
"""
CLOUD, _REAL = 16, 4
_HALVINGS = 9  # of the range of strengths, before a loop is given up
_OFFSET = 1000  # seeds of the simulated cloud start here above the record's seed


class Reference(NamedTuple):
    """The faultless loop over many seeds: its cloud, and its habits as yardstick."""

    cloud: Cloud
    habit: Habit


class Ratio(NamedTuple):
    """Gap over floor: expected over realisations, and of the very record."""

    expected: float
    of_record: float


class _TrueShrinkage(NamedTuple):
    """Gap of a record to the baseline without and with the fault, and the floor, all in seed
    spreads.
    """

    before: float
    after: float
    floor: float

    @property
    def value(self) -> float | None:
        """Share of the resolvable gap that is closed; None when there is none."""
        if self.before < RESOLVABLE * self.floor:
            return None
        return 1.0 - max(self.after - self.floor, 0.0) / (self.before - self.floor)


def strength_of(ratio: float) -> str:
    """Return the strength's name: "none" below 1.3, then weak, medium, strong."""
    return next(
        (name for name in ("strong", "medium", "weak") if ratio >= STRENGTHS[name][0]), "none"
    )


def reference(case: TrueLoop, seed: int) -> Reference:
    """Simulate the loop without any fault."""
    runs = [simulate(case, seed + _OFFSET + i) for i in range(CLOUD)]
    op = np.concatenate([r.op for r in runs])
    lo, hi = np.quantile(op, (0.001, 0.999))
    habit = Habit(
        op_lo=float(lo),
        op_hi=float(hi),
        op_std=float(np.mean([r.op.std() for r in runs])),
        e_std=float(np.mean([(r.pv - r.sp).std() for r in runs])),
    )
    return Reference(cloud(runs, case.scale), habit)


def ratio(case: TrueLoop, seed: int, faults: tuple[Fault, ...], true: Cloud) -> Ratio | None:
    """Return gap / floor of the faulty loop against the true loop without the fault."""
    runs = [simulate(case, seed + i, faults) for i in range(_REAL)]
    # a loop that swings from stop to stop shows nothing of its fault
    if any(np.mean((r.op < 1.0) | (r.op > 99.0)) >= 0.01 for r in runs):
        return None
    gaps = [true.distance(features(r, case.scale)[0]) / true.floor for r in runs]
    return Ratio(float(np.mean(gaps)), gaps[0])


def find_strength(
    rate: Callable[[float], Ratio | None],
    band: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[float, Ratio] | None:
    """Search the strength in 0..1 at which the ratio falls into a band."""
    lo, hi = band
    target = float(np.exp(rng.uniform(np.log(lo * 1.05), np.log(hi * 0.95))))
    a, b = 0.0, 1.0
    least, most = rate(a), rate(b)
    if least is None or least.expected > hi or (most is not None and most.expected < lo):
        return None

    def near(rated: Ratio | None, off: float) -> bool:
        if rated is None or not lo <= rated.expected < hi:
            return False
        return bool(abs(np.log(rated.expected / target)) < off)

    for x, rated in ((a, least), (b, most)):
        if near(rated, 0.1):
            return _if_record_fits(x, rated, band)
    for _ in range(_HALVINGS):
        x = (a + b) / 2
        rated = rate(x)
        if near(rated, 0.15):
            return _if_record_fits(x, rated, band)
        if rated is None or rated.expected > target:
            b = x
        else:
            a = x
    return None


def _if_record_fits(
    x: float, rated: Ratio, band: tuple[float, float]
) -> tuple[float, Ratio] | None:
    return (x, rated) if 0.85 * band[0] <= rated.of_record < 1.15 * band[1] else None


def shrinkage(
    case: TrueLoop, seed: int, record: Signals, faults: tuple[Fault, ...]
) -> _TrueShrinkage:
    """Return how far the record's gap to the baseline handed out shrinks when faults are added to
    it.

    The load's and noise's statistics are the true ones in both; the plant is the nominal one in
    both.
    """
    nominal, seeds = case.as_nominal(), [seed + 2 * _OFFSET + i for i in range(12)]
    values = features(record, case.scale)[0]
    before = cloud([simulate(nominal, s) for s in seeds], case.scale)
    after = cloud([simulate(nominal, s, faults) for s in seeds], case.scale)
    # one yardstick for both: the spreads of the arm that holds the fault, as the floor's
    return _TrueShrinkage(
        after._replace(mean=before.mean).distance(values), after.distance(values), after.floor
    )

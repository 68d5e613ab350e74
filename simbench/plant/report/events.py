"""Find loops that share one oscillation: the same period, and phases that stay together over the
whole record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.phase import phase_locking

_NEAR = 0.12  # logarithm of the ratio of two periods up to which they may be one
_LOCKED = 0.95  # mean resultant length of the phase difference from which two oscillations are one
_FOLLOWS = 0.995  # correlation from which a set point is another loop's output
_FEWEST, _FEWEST_PERIODS = (
    20,
    6,
)  # samples, and periods, of common time below which nothing is concluded
_LAGS = (0, 1)  # samples that may lie between an output and the set point that follows it


def shared_oscillations(records: Mapping[str, Prepared]) -> list[list[str]]:
    """Return the groups of loops that oscillate together by the phase-locking value of their PVs
    (Lachaux et al. 1999, eq. 1).

    Two loops that cycle by themselves drift apart; a source and its victims do not. Records without
    time stamps are taken for records of one time where they are of one length.
    """
    swinging = [
        (name, p)
        for name, p in records.items()
        if p.oscillation.sustained and np.isfinite(p.oscillation.period_s)
    ]
    joined = DisjointSet(name for name, _ in swinging)
    for i, (a, one) in enumerate(swinging):
        for b, other in swinging[:i]:
            if not joined.connected(a, b) and _together(one, other):
                joined.merge(a, b)
    groups: dict[str, list[str]] = {}
    for name, _ in swinging:
        groups.setdefault(joined[name], []).append(name)
    return sorted((g for g in groups.values() if len(g) > 1), key=lambda g: -len(g))


def _together(one: Prepared, other: Prepared) -> bool:
    periods = np.array([one.oscillation.period_s, other.oscillation.period_s])
    if abs(np.log(periods[0] / periods[1])) > _NEAR:
        return False
    both = same_time(one.record, other.record)
    if both is None:
        return False
    a, b = both
    period = float(np.sqrt(periods.prod())) / a.Ts
    return a.n >= _FEWEST_PERIODS * period and phase_locking(a.pv, b.pv, period) > _LOCKED


def same_time(a: LoopRecord, b: LoopRecord) -> tuple[LoopRecord, LoopRecord] | None:
    """Return the parts of two records that were recorded at the same time; None where there are
    none, or it is unknown.
    """
    if abs(a.Ts / b.Ts - 1) > 0.01:
        return None
    starts = [r.meta.get("start") for r in (a, b)]
    if starts[0] is None or starts[1] is None:
        return (a, b) if a.n == b.n and starts[0] is starts[1] else None
    late = round((starts[1] - starts[0]) / a.Ts)
    first, second = max(late, 0), max(-late, 0)
    n = min(a.n - first, b.n - second)
    return (a.window(first, first + n), b.window(second, second + n)) if n >= _FEWEST else None


def cascades(records: Mapping[str, LoopRecord]) -> list[tuple[str, str]]:
    """Return the pairs of outer and inner loop: the set point of the inner is the output of the
    outer.
    """
    pairs = []
    stds = {name: [_std(r.op[: r.n - k]) for k in _LAGS] for name, r in records.items()}
    for inner, slave in records.items():
        moves = _set_point(slave)
        if moves is None:
            continue
        match, outer = max(
            (_follows(record, stds[name], slave, moves), name) for name, record in records.items()
        )
        if match > _FOLLOWS:
            pairs.append((outer, inner))
    return pairs


def _set_point(slave: LoopRecord) -> list[np.ndarray] | None:
    """Return the set point without its mean and divided by its length and standard deviation, as
    it is and without its first sample; None where it hardly moves.
    """
    if slave.sp is None or np.count_nonzero(np.diff(slave.sp)) < _FEWEST:
        return None
    shifted = [slave.sp[k:] for k in _LAGS]
    return [(x - x.mean()) / (x.size * _std(x)) for x in shifted]


def _follows(
    master: LoopRecord, stds: Sequence[float], slave: LoopRecord, moves: Sequence[np.ndarray]
) -> float:
    """Return how well the output of one loop explains the set point of another, 1 = wholly; a loop
    does not follow itself.

    Most loops of a plant have the same times: for these only two scalar products are left to do,
    as there are as many pairs as loops squared.
    """
    if master is slave:
        return 0.0
    if (master.Ts, master.n, master.meta.get("start")) != (
        slave.Ts, slave.n, slave.meta.get("start")
    ):  # fmt: skip
        both = same_time(master, slave)
        again = None if both is None else _set_point(both[1])
        if both is None or again is None:
            return 0.0
        master, moves = both[0], again
        stds = [_std(master.op[: master.n - k]) for k in _LAGS]
    return max(
        abs(float(master.op[: master.n - k] @ moves[k])) / stds[k] if stds[k] else 0.0
        for k in _LAGS
    )


def _std(x: np.ndarray) -> float:
    """Return a standard deviation, exactly 0 for a constant."""
    return float(np.std(x)) if x.size and np.ptp(x) else 0.0


def likely_root(
    group: Sequence[str], probability: Mapping[str, float], nonlinear: Mapping[str, float]
) -> list[str]:
    """Return the loops of one event, the likely root first."""
    return sorted(
        group, key=lambda name: (-round(probability.get(name, 0.0), 1), -nonlinear.get(name, 0.0))
    )

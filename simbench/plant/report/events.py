"""Find loops that share one oscillation: the same period, and phases that stay together over the
whole record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from detectors.prepared import Prepared
from detectors.record import LoopRecord
from detectors.signal.phase import phase_locking

_NEAR = 0.12  # logarithm of the ratio of two periods up to which they may be one
_LOCKED = 0.95  # mean resultant length of the phase difference from which two oscillations are one
_FOLLOWS = 0.995  # correlation from which a set point is another loop's output
_FEWEST, _FEWEST_PERIODS = (
    20,
    6,
)  # samples, and periods, of common time below which nothing is concluded


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
    both = same_time(one.record, other.record)
    if both is None:
        return False
    a, b = both
    periods = np.array([one.oscillation.period_s, other.oscillation.period_s]) / a.Ts
    if abs(np.log(periods[0] / periods[1])) > _NEAR:
        return False
    period = float(np.sqrt(periods.prod()))
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
    for inner, slave in records.items():
        if slave.sp is None or np.ptp(slave.sp) == 0.0:
            continue
        # a loop does not follow itself
        match, outer = max((_follows(record, slave), name) for name, record in records.items())
        if match > _FOLLOWS:
            pairs.append((outer, inner))
    return pairs


def _follows(master: LoopRecord, slave: LoopRecord) -> float:
    """Return how well the output of one loop explains the set point of another, 1 = wholly; one
    sample may lie between.
    """
    both = None if master is slave else same_time(master, slave)
    if both is None or both[1].sp is None:
        return 0.0
    op, sp = both[0].op, both[1].sp
    if np.ptp(op) == 0.0 or np.ptp(sp) == 0.0 or np.count_nonzero(np.diff(sp)) < _FEWEST:
        return 0.0
    return max(abs(float(np.corrcoef(op[: op.size - k], sp[k:])[0, 1])) for k in (0, 1))


def likely_root(
    group: Sequence[str], probability: Mapping[str, float], nonlinear: Mapping[str, float]
) -> list[str]:
    """Return the loops of one event, the likely root first."""
    return sorted(
        group, key=lambda name: (-round(probability.get(name, 0.0), 1), -nonlinear.get(name, 0.0))
    )

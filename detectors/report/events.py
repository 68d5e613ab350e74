"""Find loops that share one oscillation: the same period, and phases that stay together over the
whole record.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.filters import phase_locking

_NEAR = 0.12  # logarithm of the ratio of two periods up to which they may be one
_LOCKED = 0.95  # mean resultant length of the phase difference from which two oscillations are one
# of common time, below which nothing is concluded
_FEWEST = 20  # samples
_FEWEST_PERIODS = 6


def event_numbers(records: Mapping[str | None, LoopRecord]) -> dict[str, int]:
    """Return a number for every loop that oscillates together with others, one a group, from 1."""
    prepared = {}
    for name, record in records.items():
        prepared[str(name)] = Prepared(record.without_mv())
    groups = enumerate(shared_oscillations(prepared), 1)
    numbers = {}
    for number, group in groups:
        for name in group:
            numbers[name] = number
    return numbers


def shared_oscillations(records: Mapping[str, Prepared]) -> list[list[str]]:
    """Return the groups of loops that oscillate together by the phase-locking value of their PVs
    (Lachaux et al. 1999, eq. 1).

    Two loops that cycle by themselves drift apart; a source and its victims do not. Records without
    time stamps are taken for records of one time where they are of one length.
    """
    # loops that oscillate
    swinging = []
    for name, p in records.items():
        if p.oscillation.sustained and np.isfinite(p.oscillation.period_s):
            swinging.append((name, p))

    # join every two that swing together
    joined = scipy.cluster.hierarchy.DisjointSet(name for name, _ in swinging)
    for i, (a, one) in enumerate(swinging):
        for b, other in swinging[:i]:
            if not joined.connected(a, b) and _swing_together(one, other):
                joined.merge(a, b)

    # groups of more than one, the largest first
    groups: dict[str, list[str]] = {}
    for name, _ in swinging:
        groups.setdefault(joined[name], []).append(name)
    return sorted((g for g in groups.values() if len(g) > 1), key=lambda g: -len(g))


def _swing_together(one: Prepared, other: Prepared) -> bool:
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
    # One clock, and times of their starts
    if abs(a.Ts / b.Ts - 1) > 0.01:
        return None
    starts = [r.meta.get("start") for r in (a, b)]
    if starts[0] is None or starts[1] is None:
        if a.n == b.n and starts[0] is starts[1]:
            return (a, b)
        return None

    # What both cover
    late = round((starts[1] - starts[0]) / a.Ts)
    first = max(late, 0)
    second = max(-late, 0)
    n = min(a.n - first, b.n - second)
    if n >= _FEWEST:
        return (a.window(first, first + n), b.window(second, second + n))
    return None

"""Simulate other ways to record a loop that would make a stiction visible that this record cannot
show.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbench.detectors.verdict import STICTION
from simbench.gap.stiction.altered import without
from simbench.gap.stiction.candidate_loops import ARCHIVE, CandidateLoops, archive_effects
from simbench.trust.replicates import Change, draw_replicates, judged

_REPLICATES = 24  # of each kind, per remedy
_WORTH = 0.2  # by which a remedy must raise sensitivity minus false alarms to be named
_LONGEST = 20000  # samples beyond which a longer record is not simulated


@dataclass(frozen=True)
class Remedy:
    """One other way to record the loop, and the shares of sticky and of healthy replicates that the
    best method then calls stiction.

    `S` is the size tried, with full slip-jump; `before` the sensitivity minus false alarms of the
    record as it is.
    """

    what: str
    method: str
    S: float
    unit: str
    share: float
    alarms: float
    before: float

    @property
    def gain(self) -> float:
        """Increase of sensitivity minus false alarms."""
        return self.share - self.alarms - self.before

    def sentence(self) -> str:
        """Return what would help in one sentence."""
        if not self.what:
            return (
                "would help: none of the changes tried (a record four times as long, faster"
                " sampling, a set-point step, MV, another archive) makes S ="
                f" {self.S:.2g} {self.unit} visible"
            )
        return (
            f"would help: {self.what}; {self.method} would then detect S ="
            f" {self.S:.2g} {self.unit} in {self.share:.0%} of simulated replicates, with"
            f" {self.alarms:.0%} false positives (difference {self.share - self.alarms:.0%}; in"
            f" this record {max(self.before, 0.0):.0%})"
        )


def remedies(
    candidates: CandidateLoops,
    methods: Sequence[str],
    cell: tuple[float, float],
    percent: float,
    unit: str,
    seed: int,
    jobs: int,
) -> tuple[Remedy, ...]:
    """Simulate what could be recorded otherwise, and return what would show more, best first."""
    before = max(
        share - alarms
        for _, share, alarms in _shares(candidates, methods, cell, Change(), seed, jobs)
    )
    S, tried = cell[0] * percent, []
    for what, change in _changes(candidates, cell[0]):
        name, share, alarms = max(
            _shares(candidates, methods, cell, change, seed, jobs),
            key=lambda row: row[1] - row[2],
        )
        tried.append(Remedy(what, name, S, unit, share, alarms, before))
    worth = sorted((r for r in tried if r.gain >= _WORTH), key=lambda r: -r.gain)
    return tuple(worth) or (Remedy("", "", S, unit, 0.0, 0.0, before),)


def _changes(a: CandidateLoops, S: float) -> list[tuple[str, Change]]:
    record, loop = a.record, a.healthy[0]
    out = []
    if record.n * 4 <= _LONGEST:
        out.append(
            (
                f"{_hours(4 * record.duration)} of record in place of {_hours(record.duration)}",
                Change(longer=4.0),
            )
        )
        out.append(
            (
                f"a sample every {record.Ts / 3:.3g} s in place of every {record.Ts:.3g} s",
                Change(faster=3),
            )
        )
    # as much PV as three times the band moves it; an integrating plant has no gain of that kind
    high = (
        abs(loop.plant.K) * 3.0 * S
        if not loop.plant.integrating
        else 4.0 * float(np.std(record.pv))
    )
    out.append((f"set-point steps of {high:.2g} (unit of PV)", Change(step=high)))
    if record.mv is None:
        out.append(("recording the valve position (MV)", Change(mv=True)))
    if archive_effects(loop):
        out.append(
            (
                "an archive without compression and rounding",
                Change(loop=lambda table: without(table, ARCHIVE)),
            )
        )
    return out


def _shares(
    a: CandidateLoops,
    methods: Sequence[str],
    cell: tuple[float, float],
    change: Change,
    seed: int,
    jobs: int,
) -> list[tuple[str, float, float]]:
    """Return per method the share of sticky and of healthy replicates that it calls stiction."""
    replicates = draw_replicates(
        a, _REPLICATES, _REPLICATES, cells=[cell], change=change, seed=seed + 1
    )
    sticky = np.array([t.S > 0 for t in replicates], dtype=bool)
    if sticky.all() or not sticky.any():
        return [("", 0.0, 0.0)]
    called = np.array(
        [[v.verdict == STICTION for v in row] for row in judged(replicates, methods, jobs)]
    )
    return [
        (m, float(called[sticky, i].mean()), float(called[~sticky, i].mean()))
        for i, m in enumerate(methods)
    ]


def _hours(seconds: float) -> str:
    return (
        f"{seconds / 3600:.1f} h"
        if seconds >= 3600
        else f"{seconds / 60:.0f} min"
        if seconds >= 120
        else f"{seconds:.0f} s"
    )

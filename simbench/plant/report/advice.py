"""Choose who works on a loop next (valve, tuning, upstream, measurement or nobody), and what to
do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from simbench.detectors.prepared import Prepared
from simbench.detectors.verdict import NO_DECISION, NO_STICTION
from simbench.gap.stiction import causes as why
from simbench.gap.stiction.conclusion import Conclusion
from simbench.plant.report.what_if import LEAVE, REPAIR, RETUNE, Action

VALVE, TUNING, UPSTREAM, MEASUREMENT, NOBODY = "valve", "tuning", "upstream", "measurement", "none"

_JOBS = {
    why.STICKING: VALVE,
    why.TIGHT: TUNING,
    why.FROM_OUTSIDE: UPSTREAM,
    why.NEIGHBOUR: UPSTREAM,
    why.SENSOR: MEASUREMENT,
    why.AT_LIMIT: VALVE,
    why.NO_CAUSE: NOBODY,
}
_HELPS = {why.STICKING: REPAIR, why.TIGHT: RETUNE}


@dataclass(frozen=True)
class Advice:
    """Whose job, and what to do."""

    job: str
    do: str


def advise(
    concluded: Conclusion,
    prepared: Prepared,
    named: why.Cause,
    root: str | None,
    actions: Sequence[Action],
) -> Advice:
    """Return what to do next with one loop: the conclusion's next step, with what a plant's other
    loops and replicates add.
    """
    swings = prepared.oscillation.sustained
    action = next(
        (a for a in actions if a.name == _HELPS.get(named.name) and a.variance < 1.0), None
    )
    about = {
        why.AT_LIMIT: named.speaks_for[:1],
        why.SENSOR: named.speaks_for[:1],
        why.TIGHT: named.speaks_for[:1] if action is None else (action.sentence(),),
        why.STICKING: () if action is None else (action.effect(),),
        why.NEIGHBOUR: (f"that loop is {root}",),
        why.FROM_OUTSIDE: (f"the period is {prepared.oscillation.period_s:.3g} s",),
    }
    details = about.get(named.name, ())
    if concluded.probability is None and named.name == why.NOT_TOLD:
        return Advice(MEASUREMENT, f"{concluded.next}: {concluded.reason}")
    job = _JOBS.get(named.name)
    if job is None:
        open_valve = VALVE if concluded.verdict == NO_DECISION else TUNING
        job = open_valve if swings else MEASUREMENT if concluded.verdict != NO_STICTION else NOBODY
    return Advice(job, "; ".join([concluded.next, *details]))


def best(actions: Sequence[Action]) -> Action | None:
    """Return the action ranked first, None where leaving it is."""
    return actions[0] if actions and actions[0].name != LEAVE else None

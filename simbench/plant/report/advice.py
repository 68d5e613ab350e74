"""What to do next with a loop, and whose job it is: valve, tuning, upstream, measurement, or nobody's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from detectors.prepared import Prepared
from simbench.gap.stiction import causes as why
from simbench.plant.report.what_if import LEAVE, REPAIR, RETUNE, Action
from simbench.plant.trust.result import OPEN, UNSEEN, Trust

VALVE, TUNING, UPSTREAM, MEASUREMENT, NOBODY = "valve", "tuning", "upstream", "measurement", "none"

_GAIN = "change the controller gain by 30 to 50 % and watch the period"
BY_CAUSE = {  # whose job it is, and what to do
    why.STICKING: (VALVE, f"confirm on the valve: {_GAIN}, or a travel test by hand; then repair it"),
    why.TIGHT: (TUNING, "retune the controller"),
    why.FROM_OUTSIDE: (UPSTREAM, "look upstream for what oscillates with this period"),
    why.NEIGHBOUR: (UPSTREAM, "see to the loop that drives this oscillation first, then record again"),
    why.SENSOR: (MEASUREMENT, "check the transmitter"),
    why.AT_LIMIT: (VALVE, "free OP from its limit (valve size, operating point), then record again"),
    why.NO_CAUSE: (NOBODY, "nothing to do"),
    why.NOT_TOLD: (VALVE, f"{_GAIN}: it tells friction from everything else"),
}
_HELPS = {why.STICKING: REPAIR, why.TIGHT: RETUNE}


@dataclass(frozen=True)
class Advice:
    """Whose job, and what to do."""

    job: str
    do: str


def advise(found: Trust, prepared: Prepared, named: why.Cause, root: str | None, actions: Sequence[Action]) -> Advice:
    """Return what to do next with one loop, by the cause that its evidence names."""
    job, do = BY_CAUSE[named.name]
    if named.name in (why.AT_LIMIT, why.SENSOR):
        return Advice(job, f"{do}: {named.speaks_for[0]}")
    if found.probability is None:
        return Advice(MEASUREMENT, f"get a record that can be judged: {found.notes[0]}")
    if named.name == why.NOT_TOLD:
        return _to_tell(found, prepared)
    action = next((a for a in actions if a.name == _HELPS.get(named.name) and a.variance < 1.0), None)
    if action is not None:
        return Advice(job, f"{do}: {action.sentence()}")
    about = {
        why.TIGHT: named.speaks_for[:1],
        why.NEIGHBOUR: (root,),
        why.FROM_OUTSIDE: (f"{prepared.oscillation.period_s:.3g} s",),
    }
    return Advice(job, ": ".join([do, *map(str, about.get(named.name, ()))]))


def _to_tell(found: Trust, prepared: Prepared) -> Advice:
    """Return what would tell, where no cause is named."""
    unsure = found.answer in (UNSEEN, OPEN)
    if unsure and found.helps and found.helps[0].what:
        return Advice(MEASUREMENT, f"record otherwise: {found.helps[0].what}")
    if prepared.oscillation.sustained:
        return Advice(*BY_CAUSE[why.NOT_TOLD])
    if found.answer == UNSEEN:
        return Advice(NOBODY, "nothing seen, and nothing could have been: record longer before the valve is called sound")
    return Advice(NOBODY, "nothing to do now: watch whether it swings")


def best(actions: Sequence[Action]) -> Action | None:
    """Return the action ranked first, None where leaving it is."""
    return actions[0] if actions and actions[0].name != LEAVE else None

"""What to do next with a loop, and whose job it is: valve, tuning, upstream, measurement, or nobody's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from detectors.prepared import Prepared
from simbench.plant.report import causes as why
from simbench.plant.report.what_if import LEAVE, REPAIR, RETUNE, Action
from simbench.plant.trust.result import OPEN, UNSEEN, Trust

VALVE, TUNING, UPSTREAM, MEASUREMENT, NOBODY = "valve", "tuning", "upstream", "measurement", "none"


_GAIN = "change the controller gain by 30 to 50 % and watch the period"
NEXT = {  # of one record, by its cause
    why.STICKING: f"maintenance: {_GAIN}, or a travel test by hand, then repair the valve",
    why.TIGHT: "control engineer: retune the controller",
    why.FROM_OUTSIDE: "operations: look upstream for what oscillates with this period",
    why.NEIGHBOUR: "operations: see to the loop that drives it first",
    why.SENSOR: "instruments: check the transmitter",
    why.AT_LIMIT: "free OP from its limit (valve size, operating point), then record again",
    why.NO_CAUSE: "nothing to do",
    why.NOT_TOLD: f"control engineer: {_GAIN}; it tells friction from everything else",
}


@dataclass(frozen=True)
class Advice:
    """Whose job, and what to do."""

    job: str
    do: str


def advise(found: Trust, prepared: Prepared, named: why.Cause, root: str | None, actions: Sequence[Action]) -> Advice:
    """Return what to do next with one loop, by the cause that its evidence names."""
    period = f"{prepared.oscillation.period_s:.3g} s"
    by_name = {a.name: a for a in actions}
    if named.name == why.AT_LIMIT:
        return Advice(VALVE, f"free OP from its limit (valve size, operating point): {named.speaks_for[0]}; then record again")
    if named.name == why.SENSOR:
        return Advice(MEASUREMENT, f"check the transmitter: {named.speaks_for[0]}")
    if found.probability is None:
        return Advice(MEASUREMENT, f"get a record that can be judged: {found.notes[0]}")
    if named.name == why.NEIGHBOUR:
        return Advice(UPSTREAM, f"see to {root} first, which likely drives this oscillation, then record again")
    if named.name == why.STICKING:
        test = "confirm on the valve: change the controller gain and watch the period, or a travel test by hand"
        return Advice(VALVE, test + (f"; then {by_name[REPAIR].sentence()}" if REPAIR in by_name else ""))
    if named.name == why.FROM_OUTSIDE:
        return Advice(UPSTREAM, f"look upstream for what oscillates with a period of {period}")
    if named.name == why.TIGHT:
        helps = RETUNE in by_name and by_name[RETUNE].variance < 1.0  # else calmer, at the price of slower loads
        return Advice(TUNING, by_name[RETUNE].sentence() if helps else f"retune, calmer: {named.speaks_for[0]}")
    if named.name == why.NO_CAUSE:
        return Advice(NOBODY, "nothing to do")
    return _to_tell(found, prepared)


def _to_tell(found: Trust, prepared: Prepared) -> Advice:
    """Return what would tell, where no cause is named."""
    unsure = found.answer in (UNSEEN, OPEN)
    if unsure and found.helps and found.helps[0].what:
        return Advice(MEASUREMENT, f"record otherwise: {found.helps[0].what}")
    if prepared.oscillation.sustained:
        return Advice(VALVE, "change the controller gain and watch the period: it tells friction from everything else")
    if found.answer == UNSEEN:
        return Advice(NOBODY, "nothing seen, and nothing could have been: record longer before the valve is called sound")
    return Advice(NOBODY, "nothing to do now: watch whether it swings")


def best(actions: Sequence[Action]) -> Action | None:
    """Return the action ranked first, None where leaving it is."""
    return actions[0] if actions and actions[0].name != LEAVE else None

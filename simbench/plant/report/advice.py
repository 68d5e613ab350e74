"""What to do next with a loop, and whose job it is: valve, tuning, upstream, measurement, or nobody's."""

from __future__ import annotations

from dataclasses import dataclass

from detectors.prepared import Prepared
from simbench.plant.trust.result import OPEN, STICKY, UNSEEN, Trust

_VALVE, _TUNING, _UPSTREAM, _MEASUREMENT, _NOBODY = "valve", "tuning", "upstream", "measurement", "none"


@dataclass(frozen=True)
class Advice:
    """Whose job, and what to do."""

    job: str
    do: str


def advise(found: Trust, prepared: Prepared, root: str | None) -> Advice:
    """Return what to do next with one loop."""
    if found.probability is None:
        return Advice(_MEASUREMENT, f"get a record that can be judged: {found.notes[0]}")
    if root is not None:
        return Advice(_UPSTREAM, f"see to {root} first, which likely drives this oscillation, then record again")
    if found.answer == STICKY:
        return Advice(_VALVE, "confirm on the valve: change the controller gain and watch the period, or a travel test by hand")
    swinging = prepared.oscillation.sustained
    if found.answer in (UNSEEN, OPEN) and found.helps and found.helps[0].what:
        return Advice(_MEASUREMENT, f"record otherwise: {found.helps[0].what}")
    if swinging and found.answer in (UNSEEN, OPEN):
        return Advice(_VALVE, "change the controller gain and watch the period: it tells friction from everything else")
    if swinging and _driven(found):
        return Advice(_UPSTREAM, f"look upstream for what oscillates with a period of {prepared.oscillation.period_s:.3g} s")
    if swinging:
        return Advice(_TUNING, "check the tuning: the loop swings by itself without friction")
    if found.answer == UNSEEN:
        return Advice(_NOBODY, "nothing seen, and nothing could have been: record longer before the valve is called sound")
    return Advice(_NOBODY, "nothing to do")


def _driven(found: Trust) -> bool:
    """Return whether an oscillation from outside is the likelier explanation without friction."""
    if found.behind is None:
        return False
    return any(e["name"] == "oscillation" for e in found.behind.healthy[0].to_table().get("effect", []))

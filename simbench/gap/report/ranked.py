"""A line of the ranking and the gap of a diagnosis, and the words for effects and numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from simbench.gap.closed_loop.gap import within_reach
from simbench.gap.thresholds import LIKELIER
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, block_of

PERCENT = "% of travel"  # unit of S and J where OP is a percentage
LEAST_SHOWN = 0.005  # probability from which an explanation is shown: what does not round to 0 %


@dataclass(frozen=True)
class Ranked:
    """One line of the ranking; `group` are the answers that this record cannot tell from it, itself
    among them.
    """

    effect: str
    block: str
    probability: float
    gap_before: float | None
    gap_after: float | None
    parameters: dict[str, float | str]
    group: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the line in JSON types."""
        return asdict(self) | {"group": list(self.group)}

    def as_answer(self) -> dict[str, Any]:
        """Return the line as an effect of the answer."""
        kept = ("block", "effect", "parameters", "probability")
        return {key: getattr(self, key) for key in kept}


@dataclass(frozen=True)
class Gap:
    """Mean distance of the held-out part's features from the simulation's, in seed-to-seed standard
    deviations; `plant_floor` is `floor` times how much less the record repeats itself, set-point
    moves apart, than a simulation does.
    """

    before: float
    recalibrated: float
    after: float
    floor: float
    resolvable: bool
    plant_floor: float

    @property
    def near(self) -> bool:
        """Whether the simulation is near the record, with the answer in it."""
        return within_reach(self.after, self.plant_floor)


def words(effect: str) -> str:
    """Return an id as words."""
    return effect.replace("_", " ")


def numbers(
    effect: str, parameters: dict[str, float | str], begin: str = ", ", op_unit: str = PERCENT
) -> str:
    """Return parameters as `S = 2.1, J = 0.4 % of travel`: neighbours of one unit show it once.

    `op_unit` takes the place of % where OP of the record is no percentage.
    """
    # Units of the effect's parameters; OP's own unit where travel is not known
    if effect in EFFECTS:
        known = EFFECTS[effect].parameters
    else:
        known = {}
    units = [getattr(known.get(k), "unit", "") for k in parameters]
    if op_unit != PERCENT:
        units = [re.sub(f"^({PERCENT}|%)", op_unit, unit) for unit in units]

    # A unit that the next number shares is told once, behind it
    parts = []
    for (k, v), unit, after in zip(parameters.items(), units, units[1:] + [""]):
        if isinstance(v, (int, float)):
            value = f"{v:.3g}"
        else:
            value = v
        parts.append(f"{k} = {value}" + (f" {unit}" if unit not in ("", "-", after) else ""))
    if parts:
        return begin + ", ".join(parts)
    return ""


# --- What would tell apart the effects between which one record does not decide: a sentence from
# a table.

_MV = "the valve position (MV) recorded with OP"
# what shows an effect whatever else may explain the record, by effect or by block; the first line
# that shows one of those in question is said
MEASUREMENTS = (
    (_MV, {"valve"}),
    ("the controller's settings, read from its display,", {"controller"}),
    ("PV logged without the archive", {"quantisation", "compression", "frozen_sensor", "outliers"}),
    ("laboratory samples of the process value", {"drift", "sensor_lag", "noise"}),
    ("steps of the set point, recorded until PV has settled,", {"process"}),
    ("a record in manual, OP at rest,", {"disturbance"}),
)
_RIVAL = (
    0.1  # probability from which a second effect is in question; a choice, as 90 % sets have it
)


def tell_apart(ranking: Sequence[Ranked], mv_recorded: bool) -> str | None:
    """Return what would tell the first effects of a ranking apart, in a sentence without its stop;
    None where the record decides, or nothing known is in question.
    """
    # those that this record cannot tell from the first, or else its rivals
    first = ranking[0]
    if first.effect == UNKNOWN:
        return None
    question = [effect for effect in first.group if effect != NONE]
    if len(question) < 2 and first.probability <= 1.0 - _RIVAL:
        rivals = [one for one in ranking if one.probability >= _RIVAL]
        question = [one.effect for one in rivals if one.effect not in (NONE, UNKNOWN)]
    if not question or (question == [first.effect] and first.probability > LIKELIER):
        return None

    # the first measurement that shows one of them; an MV that is there has told what it can
    for measurement, shown in MEASUREMENTS:
        if measurement == _MV and mv_recorded:
            continue
        if any(effect in shown or block_of(effect) in shown for effect in question):
            names = [words(effect) for effect in question]
            names += ["no effect"] * (len(names) == 1)
            return f"{measurement} would tell them apart: {' and '.join(sorted(names))}"
    return None

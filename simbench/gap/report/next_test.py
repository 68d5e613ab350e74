"""What would tell apart the effects between which one record does not decide: a sentence from a
table.
"""

from __future__ import annotations

from collections.abc import Sequence

from simbench.gap.report.ranked import Ranked, words
from simbench.gap.thresholds import LIKELIER
from simbench.loop.effects import NONE, UNKNOWN, block_of

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

"""The loop that copies one record, for a grid made from records: with a sound valve, and with the
friction that the record shows taken out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError, Refusal, UserError
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.gap import describe_gap, within_reach
from simbench.gap.diagnosis import diagnose
from simbench.gap.effects import is_friction
from simbench.gap.report.result import GapReport
from simbench.gap.stiction.altered import FRICTION
from simbench.gap.stiction.measured import op_range
from simbench.gap.thresholds import LIKELIER, NARROWEST, WORTH_REPAIRING
from simbench.scenarios.spec import Loop


@dataclass(frozen=True)
class NearLoop:
    """The loop that copies a record, its valve sound, and the S (%) from which friction would show
    in the record.

    `digest` is the record's.
    """

    digest: str
    loop: Loop
    S: float

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {**vars(self), "loop": self.loop.to_table()}

    @classmethod
    def from_json(cls, kept: dict[str, Any]) -> NearLoop:
        """Return what `as_json` wrote."""
        return cls(**{**kept, "loop": Loop.from_table(kept["loop"], "near loop")})


def near_loop(record: LoopRecord, seed: int = 0) -> NearLoop | Refusal:
    """Return the loop that copies a record, or why there is none, in a sentence."""
    try:
        return loop_of(diagnose(record, identify=True, seed=seed), record)
    except UserError as why:
        return Refusal(str(why))
    except Exception as fault:
        return Refusal(sentence_of(fault))


def loop_of(report: GapReport, record: LoopRecord) -> NearLoop:
    """Return the loop that copies the record of a diagnosis whose loop was identified; RecordError
    where none is near it.

    What its load is drawn again from is what the likelier model left: where friction is likelier
    than not, the residuals of a model without it would carry its motion into a healthy loop.
    """
    # here, for it loads the benchmark
    from simbench.bench.execute.compute_piece import record_hash

    runs = report.behind.loops
    situation = report.behind.found.situation
    probability = report.conclusion.probability
    likely = probability is not None and probability > LIKELIER
    if likely and FRICTION in runs.fitted.parameters:
        effects = [FRICTION]
    else:
        effects = []
    gap = runs.shrink(effects)
    if not within_reach(gap.after, gap.plant_floor):
        far = describe_gap(gap.after, gap.plant_floor)
        raise RecordError(f"no loop is near the record: the nearest is {far}")
    S = max(WORTH_REPAIRING, NARROWEST * op_range(np.asarray(situation.op)))
    loop = _without_friction(runs.corrected(effects))
    return NearLoop(record_hash(record), loop, float(S))


def _without_friction(loop: Loop) -> Loop:
    """Return a loop without the effects of a valve that sticks, and without the push that set it
    moving.
    """
    effects = []
    for e in loop.effect:
        if not is_friction(e.name):
            effects.append(e)
    effects = tuple(effects)
    loads = []
    for d in loop.disturbance:
        if d.parameters.get("at") != "op":
            loads.append(d)
    loads = tuple(loads)
    return loop.model_copy(update={"effect": effects, "disturbance": loads})

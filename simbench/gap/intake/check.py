"""Check before a diagnosis whether the record is fit, whether the baseline belongs to it, and what
can be judged.
"""

from __future__ import annotations

from dataclasses import replace

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.candidates import proven
from simbench.gap.intake.archive import archived
from simbench.gap.intake.observed import Observed
from simbench.gap.intake.refuse import refuse_unusable
from simbench.gap.situation import Situation
from simbench.loop.effects import block_of


def check(
    record: LoopRecord, baseline: Loop, trusted: bool = True, tuned: bool | None = None
) -> Situation:
    """Raise an error if record and baseline cannot be compared; otherwise return what is known
    without a fit: the archive's properties, the controller law, the effects proven by single
    samples. `trusted`: the baseline was given, not identified; `tuned`: its tuning is known too.
    """
    it = Observed(record, baseline, trusted, trusted if tuned is None else tuned)
    refuse_unusable(it)
    archive, plant_pv, resolution, unexplained = archived(it)
    situation = Situation(
        it.record,
        it.baseline,
        it.trusted,
        it.tuned,
        it.op,
        it.sp,
        it.law,
        it.samples,
        archive,
        plant_pv,
        it.data(plant_pv, resolution),
        it.notes,
        frozen=it.frozen and archive.rounding is None and archive.band == 0.0,
        unexplained_law=unexplained if it.tuned else "",
    )
    # what a block of the loop file is stated to do is not told from what else may happen there
    blocks = {block_of(e) for e in situation.stated}
    if "sensor" in blocks:
        situation = replace(situation, frozen=False)
    if "controller" in blocks:
        situation = replace(situation, unexplained_law="")
    named = ", ".join(sorted(situation.stated))
    notes = [f"the loop file states {named}: what it states is no gap, of whatever size"]
    return replace(
        situation,
        proven=proven(situation),
        notes=[*situation.notes, *(notes if named else [])],
    )

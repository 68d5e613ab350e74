"""Check before a diagnosis whether the record is fit, whether the baseline belongs to it, and what
can be judged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.gap.candidates import proven
from simbench.gap.intake.archive import find_archive, unexplained
from simbench.gap.intake.observed import (
    data_of,
    is_frozen,
    law_of,
    notes_of,
    op_in_percent,
    stated_noise,
)
from simbench.gap.intake.other_loop import refuse_other_controller
from simbench.gap.intake.refuse import (
    refuse_mv_units,
    refuse_op_units,
    refuse_other_pace,
    refuse_unfit,
)
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import Archive, Situation
from simbench.loop.effects import block_of
from simbench.scenarios.spec import Loop


def check(
    record: LoopRecord, baseline: Loop, trusted: bool = True, tuned: bool | None = None
) -> Situation:
    """Raise an error if record and baseline cannot be compared; otherwise return what is known
    without a fit: the archive's properties, the controller law, the effects proven by single
    samples. `trusted`: the baseline was given, not identified; `tuned`: its tuning is known too.
    """
    tuned = trusted if tuned is None else tuned
    where = f"record {record.tag!r}" if record.tag else "record"
    op = op_in_percent(record, trusted or tuned, where)
    refuse_unfit(record, where)
    refuse_other_pace(record.Ts, baseline.sampling.Ts, where)
    if record.mv is not None:
        refuse_mv_units(record.mv, op, where)
    noise = stated_noise(baseline, record.Ts) if trusted else 0.0
    law = law_of(record, op, baseline, tuned, noise)
    samples = inspect_samples(record.pv, record.op, noise=noise)
    if tuned:
        Kc = baseline.controller.sign * baseline.controller.Kc
        refuse_op_units(record.op, law, Kc, baseline.controller.Ti, where)
        if samples.step == 0.0:
            # what a coarse PV makes of an error can look like any gain
            refuse_other_controller(law, Kc, where)
    s = Situation(
        record,
        baseline,
        trusted,
        tuned,
        op,
        np.full(record.n, record.pv.mean()) if record.sp is None else record.sp,
        law,
        samples,
        Archive(),
        record.pv,
        data_of(record, op, baseline, trusted, noise, law.late),
        notes_of(record, law),
    )
    archive, plant_pv, mismatch = find_archive(s)
    rounded, at = archive.rounding or (samples.hidden, "loop")
    unrounded = archive.rounding is None and archive.band == 0.0
    s = replace(
        s,
        archive=archive,
        plant_pv=plant_pv,
        data=replace(
            s.data,
            y=np.ascontiguousarray(plant_pv, dtype=float),
            resolution=rounded if at == "loop" else samples.resolution,
        ),
        frozen=unrounded and is_frozen(record, op, samples, noise),
    )
    # what a block of the loop file is stated to do is not told from what else may happen there
    blocks, named = {block_of(e) for e in s.stated}, ", ".join(sorted(s.stated))
    s = replace(
        s,
        frozen=s.frozen and "sensor" not in blocks,
        unexplained_law=unexplained(s, mismatch) if tuned and "controller" not in blocks else "",
    )
    notes = [f"the loop file states {named}: what it states is no gap, of whatever size"]
    return replace(s, proven=proven(s), notes=[*s.notes, *(notes if named else [])])

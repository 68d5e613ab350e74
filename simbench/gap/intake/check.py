"""Check before a diagnosis whether the record is fit, whether the baseline belongs to it, and what
can be judged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.gap.candidates import proven
from simbench.gap.intake.archive import find_archive, why_no_law, with_card
from simbench.gap.intake.clock import on_one_clock, pv_late, without_repeats
from simbench.gap.intake.observed import (
    data_of,
    is_frozen,
    law_of,
    notes_of,
    op_in_percent,
    remarks_of,
    stated_noise,
)
from simbench.gap.intake.other_loop import refuse_other_controller
from simbench.gap.intake.refuse import (
    refuse_op_units,
    refuse_other_pace,
    refuse_unfit,
)
from simbench.gap.intake.units import refuse_pv_units, refuse_time_units
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import Seen, Situation
from simbench.loop.effects import block_of
from simbench.scenarios.spec import Loop

_RUNS = 3  # of a controller in a sample, where it is faster than the archive
# how a report says that PV is stamped late
QUICK = (
    f"controller: it runs several times a sample, as its law shows; simulated with {_RUNS} runs,"
    " unless the loop file states its Ts in [sampling]"
)
CLOCK = "clock: OP answers PV {:g} s before it is on record; judged with PV moved back by as much"


def check(
    record: LoopRecord, baseline: Loop, trusted: bool = True, tuned: bool | None = None
) -> Situation:
    """Raise an error if record and baseline cannot be compared; otherwise return what is known
    without a fit: the archive's properties, the controller law, the effects proven by single
    samples. `trusted`: the baseline was given, not identified; `tuned`: its tuning is known too.
    """
    tuned = trusted if tuned is None else tuned
    if record.tag:
        where = f"record {record.tag!r}"
    else:
        where = "record"
    # a loop that is identified copies the archive with its repeats
    if trusted:
        record, slips = without_repeats(record)
    else:
        record, slips = (record, 0)
    op = op_in_percent(record, trusted or tuned, where)
    refuse_unfit(record, where)
    refuse_other_pace(record.Ts, baseline.sampling.Ts, where)
    if tuned:
        late = pv_late(record, op, baseline.controller)
    else:
        late = 0
    if trusted:
        refuse_pv_units(record, baseline, where)
    if late:
        record, op = on_one_clock(record, late), op[: record.n - late]
    if trusted:
        noise = stated_noise(baseline, record.Ts)
    else:
        noise = 0.0
    law = law_of(record, op, baseline, tuned, noise)
    samples = inspect_samples(record.pv, record.op, noise=noise)
    if tuned:
        Kc = baseline.controller.sign * baseline.controller.Kc
        refuse_op_units(record.op, law, Kc, baseline.controller.Ti, where)
        refuse_time_units(law, Kc, baseline.controller.Ti, where)
        if samples.step == 0.0:
            # what a coarse PV makes of an error can look like any gain
            refuse_other_controller(law, Kc, where)
    quick = law.quick and baseline.plant.dt is None
    if quick and round(record.Ts / baseline.sampling.Ts) == 1:
        # two to six runs a sample look much the same
        baseline = baseline.with_("sampling.Ts", baseline.sampling.Ts / _RUNS)
    seen = Seen(
        record=record,
        baseline=baseline,
        trusted=trusted,
        tuned=tuned,
        op=op,
        sp=np.full(record.n, record.pv.mean()) if record.sp is None else record.sp,
        noise=noise,
        law=law,
        samples=samples,
    )
    archive, plant_pv, mismatch = find_archive(seen)
    rounded, at = archive.rounding or (samples.hidden, "loop")
    resolution = rounded if at == "loop" else samples.resolution
    # what a block of the loop file is stated to do is not told from what else may happen there
    stated = sorted(part.name for part in baseline.effect)
    blocks = {block_of(e) for e in stated}
    notes = notes_of(seen)
    if quick and seen.pace == _RUNS:
        notes.append(QUICK)
    if late:
        notes.append(CLOCK.format(late * record.Ts))
    if slips:
        notes.append(f"clock: {slips} scans stand on record twice; judged without their repeats")
    if stated:
        notes.append(f"the loop file states {', '.join(stated)}: that is no gap, of whatever size")
    if not trusted:
        notes += remarks_of(record, samples, baseline.plant.integrating)
    rests = archive.rounding is None and archive.band == 0.0 and "sensor" not in blocks
    strange = tuned and "controller" not in blocks
    s = Situation(
        **vars(with_card(seen, archive)),
        archive=archive,
        data=data_of(seen, plant_pv, resolution),
        notes=notes,
        frozen=rests and is_frozen(record, op, samples, noise),
        unexplained_law=why_no_law(seen, archive, mismatch) if strange else "",
    )
    return replace(s, proven=proven(s))

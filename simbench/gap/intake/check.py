"""Check before a diagnosis whether the record is fit, whether the baseline belongs to it, and what
can be judged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.judge import FEWEST
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import still
from simbench.gap.candidates import proven
from simbench.gap.controller.law import Law
from simbench.gap.intake.archive import find_archive, why_no_law, with_card
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
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import Seen, Situation, name_of_record
from simbench.loop.effects import block_of
from simbench.scenarios.plant import Controller
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
    where = name_of_record(record)

    # a loop that is identified copies the archive with its repeats
    if trusted:
        record, slips = without_repeats(record)
    else:
        slips = 0
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


# --- Compare the clocks of PV and OP, and of the archive: a controller cannot answer what it has
# not seen, and a scan that stands on record twice was one.

_MOST = 60  # samples by which PV may be stamped late
# of the variance of OP's changes, that the law may leave on the right clock, and of what it leaves
# on the record's
_LEFT = 0.2
_SHARE = 0.3
_SHIFTED = 0.5  # of a record, that must be left
_SLIPS = 0.02  # share of scans that stand twice, above which the archive repeats values by nature


def without_repeats(record: LoopRecord) -> tuple[LoopRecord, int]:
    """Return a record without the scans that its archive took twice, as OP and PV repeat together
    and hardly ever alone, and how many these are.
    """
    op = np.append(False, np.diff(record.op) == 0.0)
    pv = np.append(False, np.diff(record.pv) == 0.0)
    twice = op & pv
    count = int(twice.sum())
    if not 0 < count <= _SLIPS * record.n or int(op.sum() + pv.sum()) > 3 * count:
        return record, 0
    manual = record.meta.get("manual")
    if manual is not None:
        record = replace(record, meta={**record.meta, "manual": np.asarray(manual)[~twice]})
    return record.with_signals(lambda x: x[~twice], Ts=record.Ts), count


def pv_late(record: LoopRecord, op: np.ndarray, controller: Controller) -> int:
    """Return by how many samples PV is stamped late against OP (%): OP answers it before it is on
    record, by the stated law; 0 where it does not, or the controller is neither P nor PI.
    """
    if controller.type not in ("P", "PI") or record.sp is None:
        return 0
    most = min(_MOST, int(_SHIFTED * record.n))
    moved = float(np.var(np.diff(op))) or 1.0
    left = np.array([_variance_left(record, op, controller, late) for late in range(most)]) / moved
    late = int(np.argmin(left))
    return late if late and left[late] < min(_LEFT, _SHARE * left[0]) else 0


def _variance_left(record: LoopRecord, op: np.ndarray, c: Controller, late: int) -> float:
    """Return the variance of what the law leaves of OP's changes, were PV stamped so many samples
    late.
    """
    n = op.size - late
    error = np.asarray(record.sp)[:n] - np.asarray(record.pv)[late:]
    change = np.diff(error) + (0.0 if c.Ti is None else record.Ts / c.Ti * error[1:])
    return float(np.var(np.diff(op[:n]) - c.sign * c.Kc * change))


def on_one_clock(record: LoopRecord, late: int) -> LoopRecord:
    """Return a record with PV moved back by so many samples, which are missing at its end."""
    n = record.n - late
    return replace(record.window(0, n), pv=np.asarray(record.pv)[late:])


# --- Compare the units of PV in record and loop file by their set points, and those of the
# integral time by the controller's law.

_CLOSE = 2e-3  # of what the loop file's set point spans, within which both agree
_LEAST_SPAN = 0.1  # of its size, that a set point which hardly moves counts as spanning
_TIMES = 60.0  # seconds of a minute
_SAME = 0.03  # relative, within which two numbers of a controller are one


class _Unit(NamedTuple):
    """PV of the record = gain times PV of the loop file + offset, and both units in words."""

    gain: float
    offset: float
    record: str
    file: str


_KNOWN = (
    _Unit(1.8, 32.0, "deg F", "deg C"),
    _Unit(1.0 / 1.8, -32.0 / 1.8, "deg C", "deg F"),
    _Unit(1.0, 273.15, "K", "deg C"),
    _Unit(1.0, -273.15, "deg C", "K"),
    _Unit(100.0, 0.0, "%", "a share of 1"),
    _Unit(0.01, 0.0, "a share of 1", "%"),
    _Unit(1000.0, 0.0, "a unit a thousand times as small", "a larger one"),
    _Unit(0.001, 0.0, "a unit a thousand times as large", "a smaller one"),
    _Unit(14.5038, 0.0, "psi", "bar"),
    _Unit(1.0 / 14.5038, 0.0, "bar", "psi"),
    _Unit(60.0, 0.0, "a flow per hour", "one per minute"),
    _Unit(1.0 / 60.0, 0.0, "a flow per minute", "one per hour"),
)


def refuse_pv_units(record: LoopRecord, baseline: Loop, where: str) -> None:
    """Refuse a record whose set point is that of the loop file in another unit."""
    # The ranges of the set point in the record and in the loop file
    if record.sp is None:
        return
    stated = baseline.setpoint
    levels = np.array([stated.value] + [level for _, level in stated.steps], dtype=float)
    file = np.array([levels.min(), levels.max()])
    seen = np.array([record.sp.min(), record.sp.max()])
    if _ranges_agree(seen, file):
        return

    # One of the known changes of unit explains the difference
    for unit in _KNOWN:
        if _ranges_agree(seen, unit.gain * file + unit.offset) and np.abs(file).max() > 0.0:
            raise RecordError(
                f"{where}: SP runs from {seen[0]:g} to {seen[1]:g}, in the loop file from"
                f" {file[0]:g} to {file[1]:g}: the record seems to be in {unit.record}, the loop"
                f" file in {unit.file}; write the loop file in the record's unit, with K ="
                f" {unit.gain * baseline.plant.K:.4g}, Kc ="
                f" {baseline.controller.Kc / unit.gain:.4g}, noise std ="
                f" {unit.gain * baseline.noise.std:.4g} and the record's set points"
            )


def _ranges_agree(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two ranges are the same, within a share of what they span."""
    span = max(float(np.ptp(other)), _LEAST_SPAN * float(np.abs(other).max()))
    return bool(np.abs(one - other).max() <= _CLOSE * span)


def refuse_time_units(law: Law, Kc: float, Ti: float | None, where: str) -> None:
    """Refuse a record whose controller is the loop file's but for an integral time in minutes."""
    if not law.known or not Ti or abs(law.Kc / Kc - 1.0) > _SAME:
        return
    for times, record, file in ((_TIMES, "s", "min"), (1.0 / _TIMES, "min", "s")):
        if abs(law.Ti / Ti / times - 1.0) <= _SAME:
            raise RecordError(
                f"{where}: its controller has Ti = {law.Ti:.4g} s, the loop file Ti = {Ti:g} s:"
                f" one seems to be in {record}, the other in {file}; write [controller] Ti ="
                f" {law.Ti:.4g}"
            )


# --- Refuse comparisons that make no sense: signals in other units, or the baseline of another
# loop; each refusal states its reason.

_LONGEST_RECORD = 50_000  # samples; beyond this the search takes hours
_SCALES = {0.16: (3.8, 20.5, "mA"), 0.01: (0.0, 1.0, "a share of 1")}  # of OP, in addition to %

SAME_TS = 0.01  # relative difference of two sampling periods that a time column may leave
_FASTEST = 10  # runs of a controller in a sample of the archive, at most


def refuse_other_pace(period: float, stated: float, where: str) -> None:
    """Refuse a record whose sampling period (s) is not the baseline's, nor a few times as long."""
    times = period / stated
    if not 1 <= round(times) <= _FASTEST or abs(times / round(times) - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {period:g} s by its time column, but the baseline says Ts ="
            f" {stated:g} s; they must agree within 1 %, or the record's be up to {_FASTEST} times"
            " as long, where the controller runs faster than the archive"
        )


def refuse_op_units(op: np.ndarray, law: Law, Kc: float, Ti: float | None, where: str) -> None:
    """Refuse OP on another scale: the law is the baseline's but for the scale's factor, and OP lies
    within the scale.
    """
    if not law.known or (Ti and abs(law.Ti / Ti - 1.0) > 0.05):
        return
    for factor, (low, high, unit) in _SCALES.items():
        if low <= op.min() and op.max() <= high and abs(law.Kc / Kc / factor - 1.0) < 0.03:
            raise RecordError(
                f"{where}: OP runs from {op.min():g} to {op.max():g} and answers PV with {factor:g}"
                f" times the baseline's Kc: it is in {unit}; give --op-span, the values that mean 0"
                " and 100 %"
            )


def refuse_unfit(record: LoopRecord, where: str) -> None:
    """Refuse a record that is too short, too long, or in which nothing moved."""
    if record.n < FEWEST:
        raise RecordError(f"{where}: {record.n} samples; a gap needs at least {FEWEST} to show")
    if record.n > _LONGEST_RECORD:
        raise RecordError(
            f"{where}: {record.n} samples; a gap is sought in at most {_LONGEST_RECORD}, cut some"
            " out with --window FROM TO"
        )
    for name, x in (("OP", record.op), ("PV", record.pv)):
        if still(x):
            raise RecordError(
                f"{where}: {name} is constant ({x[0]:g}); nothing moved, so nothing can be told"
            )

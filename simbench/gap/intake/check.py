"""The check stage: is the record fit, does the baseline belong to it, and what can be judged at all?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from detectors.errors import RecordError
from detectors.quality import inspect
from detectors.record import LoopRecord
from detectors.signal.holds import holds
from detectors.signal.lattice import hides_nothing
from detectors.signal.lines import on_line
from detectors.signal.spikes import cleaned, isolated
from scenarios.spec import Loop
from simbench.gap.candidates import proven
from simbench.gap.controller.pi_law import Law, examine_law
from simbench.gap.controller.recovered_pv import mean_of
from simbench.gap.intake.other_loop import refuse_other_controller
from simbench.gap.intake.refuse import refuse_mv_units, refuse_op_units, refuse_unfit
from simbench.gap.likelihood.model import Data
from simbench.gap.sensor.samples import Samples, inspect_samples
from simbench.gap.situation import Archive, Situation, through_valve

SAME_TS = 0.01
STEPS = 0.1  # share of samples; a set point that moves more often is another controller's output
STRAIGHT = 0.17  # share of samples on a line through their neighbours; exceptions of a quarter of the noise leave fewer
SPECKS = 0.02  # of the variance of PV's moves, that an archive may differ from what the controller saw
STUCK = 0.01  # share of samples in standstills that no chance brings


def check(record: LoopRecord, baseline: Loop, trusted: bool = True, tuned: bool | None = None) -> Situation:
    """Refuse what cannot be compared, and settle what needs no fit.

    Parameters
    ----------
    record : LoopRecord
        SP (or None), OP, PV and, where known, MV.
    baseline : Loop
        The simulation's loop; set point, operating point and length are ignored.
    trusted : bool
        False when the baseline's plant was identified from this very record.
    tuned : bool, optional
        False when its controller was; as `trusted` when absent.

    Returns
    -------
    Situation

    Raises
    ------
    RecordError
        Too short, constant OP or PV, another sampling period, MV or OP in other units, the baseline of another loop.
    """
    where = f"record {record.tag!r}" if record.tag else "record"
    tuned = trusted if tuned is None else tuned
    op = _percent(record, where, trusted or tuned)
    refuse_unfit(record, where)
    _refuse_other_pace(record, baseline, where)
    if record.mv is not None:
        refuse_mv_units(np.asarray(record.mv), op, where)
    notes = [f"data quality: {flag.name}: {flag.evidence}" for flag in inspect(record).values()]
    sp = record.sp
    notes += ["no set point recorded: the mean of PV stands for it"] if sp is None else _moves_of(sp)
    control = baseline.controller
    gain = control.sign * control.Kc
    noise = baseline.noise.std if trusted else 0.0
    law = examine_law(op, record.pv, sp, record.Ts, gain, control.Ti, tuned, noise)
    samples = inspect_samples(record.pv, record.op, noise=noise)
    if tuned:
        refuse_op_units(np.asarray(record.op), law, gain, control.Ti, where)
        if samples.step == 0.0:
            # what a coarse PV makes of an error can look like any gain
            refuse_other_controller(law, gain, where)
    archive, plant_pv, mismatch = _archive(record, law, samples, noise)
    if law.reason and not _apart(law):
        notes.append(f"controller: cannot tell, {law.reason}")
    # without noise PV stands still for the dead time alone
    stuck = noise > 0.0 and samples.stuck > STUCK
    frozen = stuck or _held(record.pv, op) > max(20, 0.02 * record.n)
    situation = Situation(
        record, baseline, trusted, tuned, op, np.full(record.n, record.pv.mean()) if sp is None else np.asarray(sp), law,
        samples, archive, plant_pv, _data(record, baseline, op, plant_pv, _rounding(archive, samples), law, trusted), notes,
        frozen=frozen and archive.rounding is None and archive.thinning == 0.0,
        unexplained_law=_unexplained(law, archive, mismatch) if tuned else "",
    )  # fmt: skip
    return replace(situation, proven=proven(situation))


def _held(pv: np.ndarray, op: np.ndarray) -> int:
    """Return the most moves of OP within one run of equal samples of PV: a loop without noise comes to rest as a whole."""
    lengths = holds(pv)
    moves = np.append(False, np.abs(np.diff(op)) > 1e-9 * float(np.abs(op).max()))
    return int(np.bincount(np.repeat(np.arange(lengths.size), lengths), moves).max())


def _refuse_other_pace(record: LoopRecord, baseline: Loop, where: str) -> None:
    Ts = baseline.sampling.Ts
    if abs(record.Ts / Ts - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {record.Ts:g} s by its time column, but the baseline says Ts = {Ts:g} s; they must agree within 1 %"
        )


def _data(
    record: LoopRecord, baseline: Loop, op: np.ndarray, plant_pv: np.ndarray, resolution: float, law: Law, trusted: bool
) -> Data:
    plant = baseline.plant
    integrating = plant.type == "integrating"
    u = through_valve(op, baseline.valve, record.Ts) if record.mv is None else np.asarray(record.mv)
    return Data(
        u=np.ascontiguousarray(u, dtype=float),
        y=np.ascontiguousarray(plant_pv, dtype=float),
        K=plant.K * (record.Ts if integrating else 1.0),
        T=0.0 if integrating else float(plant.T or 0.0) / record.Ts,
        Td=plant.Td / record.Ts,
        noise=baseline.noise.std if trusted else 0.0,
        resolution=resolution,
        trusted=trusted,
        late=law.late,
    )


def _moves_of(sp: np.ndarray) -> list[str]:
    moves = np.abs(np.diff(sp))
    count = int(np.count_nonzero(moves))
    if not 0 < count < STEPS * sp.size:
        return []
    return [f"set-point steps: SP moves in {count} step{'s' * (count > 1)}, the largest {float(moves.max()):.3g}"]


def _percent(record: LoopRecord, where: str, needed: bool) -> np.ndarray:
    percent = record.op_percent
    if percent is None:
        if needed:
            raise RecordError(
                f"{where}: OP runs from {record.op.min():g} to {record.op.max():g}, which is not % of travel; "
                "give --op-span, the values that mean 0 and 100 %"
            )
        return np.asarray(record.op)
    return np.asarray(percent)


def _rounding(archive: Archive, samples: Samples) -> float:
    if archive.rounding is None:
        return samples.digits
    step, at = archive.rounding
    return step if at == "loop" else samples.resolution


def _apart(law: Law) -> bool:
    """Return whether the archive is not what the controller saw."""
    return law.recovered_pv is not None and bool(law.reason)


def _unexplained(law: Law, archive: Archive, mismatch: str) -> str:
    """Return why no PI law turns the recorded error into OP; nothing where what stands between is known."""
    if not archive.faithful or law.gap > 0.0:
        return mismatch
    return mismatch or law.foreign or law.reason


def _archive(record: LoopRecord, law: Law, samples: Samples, noise: float) -> tuple[Archive, np.ndarray, str]:
    """Return what single samples prove of PV, the PV the controller saw, and why OP moves as no PV makes it move."""
    pv, seen = np.asarray(record.pv), law.recovered_pv
    place, thinning, step = "record" if _apart(law) else "loop", 0.0, 0.0
    if samples.step > 0.0 and not hides_nothing(samples.step, pv):
        step = samples.step
    elif samples.straight > STRAIGHT:
        kept = pv if seen is None else mean_of(pv, seen) if law.averaged else seen
        size = float(np.quantile(np.abs(pv - kept), 0.98))
        # noise that the archive's own mean has smoothed lies on lines sooner
        thinning = (size or 0.5 * float(np.std(np.diff(pv)))) if not law.averaged or size > noise else 0.0
    elif not hides_nothing(samples.digits, pv):
        step = samples.digits
    # a mean over a sample, or a few lines between samples kept, are the archive's and no effect: the controller saw PV
    blurred = seen is not None and (law.averaged or _lines_where_apart(pv, seen, samples, law.blur))
    plant_pv = np.asarray(seen) if blurred or (_apart(law) and (step or thinning)) else pv
    spikes, plant_pv, mismatch = _spikes(record, law, samples, plant_pv, thinning > 0.0 or blurred)
    return Archive((step, place) if step else None, thinning, spikes), plant_pv, mismatch


def _spikes(
    record: LoopRecord, law: Law, samples: Samples, plant_pv: np.ndarray, thinned: bool
) -> tuple[tuple[float, float, str] | None, np.ndarray, str]:
    """Return spikes as `Archive` has them, PV without those the plant did not make, and why OP moves as no PV makes it."""
    pv, seen, mismatch = np.asarray(record.pv), law.recovered_pv, ""
    spikes, heights, place = samples.spikes, samples.heights, "loop"
    if seen is not None and not law.foreign and not thinned:
        only, sizes = isolated(pv - seen, 0.0)
        # where the law is exact everywhere else, what is left of PV is the spikes alone
        strong = np.abs(sizes) > max(1e-3 * float(np.std(pv)), 5.0 * law.blur)
        only, sizes = only[strong], sizes[strong]
        plain = only.size >= 2 and samples.step == 0.0
        if plain and not stands_out(pv, only, sizes):
            specks = SPECKS * float(np.var(np.diff(pv)))
            near = bool(np.var(pv - seen) < specks)
            if near or np.var(np.diff(pv - seen)) < specks:
                # an archive that drops the samples least missed; a PV recovered a little off drifts away from it
                return None, np.asarray(seen) if near else plant_pv, ""
            mismatch = "OP moves as no PV on record makes it move"
        elif plain:
            spikes, heights, place, plant_pv = only, sizes, "record", np.asarray(seen)
    elif spikes.size >= 3 and seen is None and not _answered(record, law, spikes, heights):
        place = "record"
    if spikes.size < 3 or thinned:
        return None, plant_pv, mismatch
    if place == "loop" or seen is None:
        plant_pv = cleaned(plant_pv, spikes)
    return (spikes.size / record.n, float(np.mean(np.abs(heights))), place), plant_pv, mismatch


def _lines_where_apart(pv: np.ndarray, recovered_pv: np.ndarray | None, samples: Samples, blur: float) -> bool:
    """Return whether PV lies on straight lines wherever it is not what the controller saw: an archive thinned a little."""
    if recovered_pv is None:
        return False
    apart = np.abs(pv - recovered_pv) > max(3.0 * samples.digits, 5.0 * blur, 1e-3 * float(np.std(pv)))
    # at a decimal's distance a line through two samples kept is not quite straight
    return bool(apart.sum() >= 10 and on_line(pv, samples.digits)[apart].mean() > 0.5)


def _answered(record: LoopRecord, law: Law, spikes: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether OP jumps with the spikes of PV as the controller's gain says."""
    du = np.append(np.diff(record.op), 0.0)[np.clip(spikes - 1 + law.late, 0, record.n - 1)]
    asked = -law.Kc * heights
    return float(du @ asked) > 0.5 * float(asked @ asked)


def stands_out(pv: np.ndarray, places: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether spikes that the controller did not see stand out of their neighbours in PV by just their height."""
    inner = (places > 0) & (places < pv.size - 1)
    k, h = places[inner], heights[inner]
    if k.size < 2:
        return False
    off = pv[k] - 0.5 * (pv[k - 1] + pv[k + 1])
    return float(np.median(np.abs(off - h))) < 0.5 * float(np.median(np.abs(h)))

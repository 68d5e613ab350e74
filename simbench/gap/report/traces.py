"""Simulate the loops of a report (baseline, recalibrated, corrected) once each, to compare them
with the record.
"""

from __future__ import annotations

from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.report.ranked import Ranked
from simbench.gap.report.result import GapReport
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, UNKNOWN

RECORD = "record"
BASELINE = "baseline"
IDENTIFIED = "identified"
TUNED = "recalibrated"
FIXED = "with the effect"
SHOWN = "as the record shows it"
NEAREST = "with the nearest effect"


def nearest(report: GapReport) -> Ranked | None:
    """Return the known effect closest to an unknown one; None where the answer is known or nothing
    comes close.
    """
    fitted = (r for r in report.ranking if r.effect in EFFECTS and r.gap_after is not None)
    return next(fitted, None) if report.effect == UNKNOWN else None


def gap_sizes(report: GapReport) -> dict[str, float]:
    """Return the gap of every simulation, and both floors, in seed-to-seed standard deviations."""
    g = report.gap
    near = nearest(report)
    sizes = {"before": g.before}
    if report.behind.found.situation.stated_parts:
        sizes["recalibrated"] = g.recalibrated
    if report.named or report.behind.shown:
        sizes["after"] = g.after
    if near is not None and near.gap_after is not None:
        sizes["nearest effect"] = near.gap_after
    return sizes | {"floor": g.floor, "plant floor": g.plant_floor}


def record_in_percent(situation: Situation) -> LoopRecord:
    """Return the record as the diagnosis saw it: OP in %, a set point that was not recorded too."""
    record = situation.record
    return LoopRecord(situation.op, record.pv, record.Ts, situation.sp, record.mv)


def compared(report: GapReport) -> dict[str, LoopRecord]:
    """Return the record, and simulations of its length with the baseline, the recalibrated loop and
    the loop with the named (or nearest) effect; what cannot be simulated is left out.
    """
    runs = report.behind.loops
    near = nearest(report)
    before, tuned, _ = runs.runs_with(report.named)
    # an identified loop needs no other calibration
    loops = {IDENTIFIED: before.loop}
    if before is not tuned:
        loops = {BASELINE: before.loop, TUNED: tuned.loop}
    shown = report.named or ([near.effect] if near else [])
    if report.behind.shown:
        loops[SHOWN] = report.behind.shown.loop
    elif shown:
        loops[FIXED if report.named else NEAREST] = runs.corrected(shown)
    found = {name: run_with_seeds(loop, 0, 1) for name, loop in loops.items()}
    return {RECORD: record_in_percent(report.behind.found.situation)} | {
        name: records[0] for name, records in found.items() if records
    }


def end_of(situation: Situation, most: int = 1200) -> slice:
    """Return the end of the held-out part, at most so many samples."""
    n = situation.record.n
    return slice(max(held_out(situation), n - most), n)

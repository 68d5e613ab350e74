"""Simulate the loops of a report (baseline, recalibrated, corrected) once each, to compare them
with the record.
"""

from __future__ import annotations

from detectors.record import LoopRecord
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.report.result import GapReport
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, UNKNOWN

BASELINE, TUNED, FIXED, NEAREST = (
    "baseline",
    "recalibrated",
    "with the effect",
    "with the nearest effect",
)


def nearest(report: GapReport) -> list[str]:
    """Return the known effect closest to an unknown one, in a list; empty where the answer is known
    or nothing comes close.
    """
    fitted = [r.effect for r in report.ranking if r.effect in EFFECTS and r.gap_after is not None]
    return fitted[:1] if report.effect == UNKNOWN else []


def gap_sizes(report: GapReport) -> dict[str, float]:
    """Return the gap of every simulation, and its floor, in seed-to-seed standard deviations."""
    g = report.gap
    sizes = {"before": g.before, "recalibrated": g.recalibrated}
    if report.named:
        sizes["after"] = g.after
    for r in report.ranking:
        if r.effect in nearest(report) and r.gap_after is not None:
            sizes["nearest effect"] = r.gap_after
    return sizes | {"floor": g.floor}


def recorded(report: GapReport) -> LoopRecord:
    """Return the record as the diagnosis saw it: OP in %, a set point that was not recorded too."""
    s = report.behind.found.situation
    return LoopRecord(s.op, s.record.pv, s.record.Ts, s.sp, s.record.mv)


def simulated(report: GapReport) -> dict[str, LoopRecord]:
    """Simulate the record's length with the baseline, the recalibrated loop and the loop with the
    named (or nearest) effect; what cannot be simulated is left out.
    """
    runs, effects, close = report.behind.loops, report.named, nearest(report)
    before, tuned, _ = runs.runs_with(effects)
    loops = {BASELINE: (before.loop, 0.0), TUNED: (tuned.loop, 0.0)}
    if effects or close:
        shown = effects or close
        loops[FIXED if effects else NEAREST] = (runs.corrected(shown), runs.kick(shown))
    records = {name: run_with_seeds(loop, 0, 1, kick) for name, (loop, kick) in loops.items()}
    return {name: found[0] for name, found in records.items() if found}


def end_of(situation: Situation, most: int = 1200) -> tuple[int, int]:
    """Return first and last sample of the end of the held-out part, at most so many samples."""
    n = situation.record.n
    return max(held_out(situation), n - most), n

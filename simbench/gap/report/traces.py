"""Simulate the loops of a report (baseline, recalibrated, corrected) once each, to compare them
with the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.errors import UserError
from detectors.record import LoopRecord
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.effects import recogniser
from simbench.gap.report.result import GapReport
from simbench.loop.effects import EFFECTS, UNKNOWN
from simbench.loop.simulate import simulate

BASELINE, TUNED, FIXED, NEAREST = (
    "baseline",
    "recalibrated",
    "with the effect",
    "with the nearest effect",
)


@dataclass(frozen=True, eq=False)
class Traces:
    """Signals to draw: OP in %, PV and SP in PV units, MV in % or None, each of shape (n,), every
    `Ts` s.
    """

    op: np.ndarray
    pv: np.ndarray
    sp: np.ndarray
    mv: np.ndarray | None
    Ts: float

    def part(self, start: int, stop: int) -> Traces:
        """Return samples start to stop."""
        mv = None if self.mv is None else self.mv[start:stop]
        return Traces(self.op[start:stop], self.pv[start:stop], self.sp[start:stop], mv, self.Ts)


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


def kick_of(report: GapReport, effects: list[str]) -> float:
    """Return the offset of OP (%) that starts a cycle under these effects: a sticky loop left at
    rest may stay there.
    """
    return max(
        (
            recogniser(r.effect).initial_op_offset(r.parameters)
            for r in report.ranking
            if r.effect in effects
        ),
        default=0.0,
    )


def recorded(report: GapReport) -> Traces:
    """Return the record as the diagnosis saw it."""
    s = report.behind.found.situation
    return _trace(s.record, s.op, s.sp)


def simulated(report: GapReport) -> dict[str, Traces]:
    """Simulate the record's length with the baseline, the recalibrated loop and the loop with the
    named (or nearest) effect.
    """
    runs, effects, close = report.behind.loops, report.named, nearest(report)
    runs.shrink(effects)
    before, tuned, _ = runs.kept[tuple(effects)]
    loops = {BASELINE: (before.loop, 0.0), TUNED: (tuned.loop, 0.0)}
    if effects:
        loops[FIXED] = (report.fixed_loop(), kick_of(report, effects))
    elif close:
        loops[NEAREST] = (runs.corrected(close), kick_of(report, close))
    runs_by_name = {}
    for name, (loop, kick) in loops.items():
        try:
            record = simulate(loop, seed=0, kick=kick).record
        except UserError:
            continue
        if np.all(np.isfinite(record.pv)):
            assert record.sp is not None
            runs_by_name[name] = _trace(record, record.op, record.sp)
    return runs_by_name


def window(report: GapReport, most: int = 1200) -> tuple[int, int]:
    """Return first and last sample of the end of the held-out part, at most so many samples."""
    situation = report.behind.found.situation
    n = situation.record.n
    return max(held_out(situation), n - most), n


def _trace(record: LoopRecord, op: np.ndarray, sp: np.ndarray) -> Traces:
    mv = None if record.mv is None else np.asarray(record.mv)
    return Traces(np.asarray(op), np.asarray(record.pv), np.asarray(sp), mv, record.Ts)

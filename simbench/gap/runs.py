"""The loops behind a report (baseline, recalibrated, fixed) and one simulated record of each beside the plant's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.errors import UserError
from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.names import EFFECTS, NONE
from simbench.gap.result import GapReport
from simbench.gap.shrink import held_out
from simbench.loop.simulate import simulate

BASELINE, TUNED, FIXED = "baseline", "recalibrated", "with the effect"


@dataclass(frozen=True, eq=False)
class Trace:
    """Signals to draw: OP in %, PV and SP in PV units, MV in % or None, each of shape (n,), every `Ts` s."""

    op: np.ndarray
    pv: np.ndarray
    sp: np.ndarray
    mv: np.ndarray | None
    Ts: float

    def part(self, start: int, stop: int) -> Trace:
        """Return samples start to stop."""
        mv = None if self.mv is None else self.mv[start:stop]
        return Trace(self.op[start:stop], self.pv[start:stop], self.sp[start:stop], mv, self.Ts)


def named(report: GapReport) -> list[str]:
    """Return the effects that the answer adds to the baseline: none, one or two."""
    return [e["effect"] for e in report.effects if e["effect"] in EFFECTS]


def fixed_loop_of(report: GapReport) -> Loop:
    """Return the baseline with the named effects, the identified load and the record's set point in it.

    Parameters
    ----------
    report : GapReport
        Of `diagnose`. Where no known effect is named, the loop is recalibrated and nothing is added.

    Returns
    -------
    Loop
    """
    return report.details["arms"].loop(named(report))


def kick_of(report: GapReport) -> float:
    """Return the offset of OP (%) that starts the fixed loop's cycle: a sticky loop left at rest may stay there."""
    return float(next((e["parameters"].get("S", 0.0) for e in report.effects if e["effect"] == "stiction"), 0.0))


def recorded(report: GapReport) -> Trace:
    """Return the record as the diagnosis saw it."""
    s = report.details["found"].situation
    mv = None if s.record.mv is None else np.asarray(s.record.mv)
    return Trace(np.asarray(s.op), np.asarray(s.record.pv), np.asarray(s.sp), mv, s.record.Ts)


def simulated(report: GapReport, seed: int = 0) -> dict[str, Trace]:
    """Simulate the record's length with the baseline, the recalibrated and, where an effect is named, the fixed loop.

    Parameters
    ----------
    report : GapReport
        Of `diagnose`.
    seed : int
        Of load and noise; the same for all.

    Returns
    -------
    dict of str to Trace
        By name; a loop that cannot be simulated or runs away is left out.
    """
    arms, effects = report.details["arms"], named(report)
    arms.shrink(effects)
    before, tuned, _ = arms.kept[tuple(effects)]
    loops = {BASELINE: before.loop, TUNED: tuned.loop}
    if report.effect != NONE and effects:
        loops[FIXED] = fixed_loop_of(report)
    found = {}
    for name, loop in loops.items():
        try:
            record = simulate(loop, seed=seed, kick=kick_of(report) if name == FIXED else 0.0).record
        except UserError:
            continue
        if np.all(np.isfinite(record.pv)):
            found[name] = _trace(record)
    return found


def window(report: GapReport, most: int = 1200) -> tuple[int, int]:
    """Return first and last sample of the end of the held-out part, at most so many samples."""
    situation = report.details["found"].situation
    n = situation.record.n
    return max(held_out(situation), n - most), n


def _trace(record: LoopRecord) -> Trace:
    assert record.sp is not None
    mv = None if record.mv is None else np.asarray(record.mv)
    return Trace(np.asarray(record.op), np.asarray(record.pv), np.asarray(record.sp), mv, record.Ts)

"""Simulate how regularly the loops that may have made a record would swing by themselves: only what
is more regular than they are speaks for something outside.
"""

from __future__ import annotations

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.filters import coherence
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.deniable import steady
from simbench.gap.thresholds import FEWEST_PERIODS
from simbench.scenarios.spec import Loop

# simulations of a loop: the record is more regular than all of them by chance in one of nine cases
_SEEDS = 8


def regularity(record: LoopRecord) -> float:
    """Return the share of its phase that the record's swing keeps; 0 where it does not swing, or
    for too few periods to tell.
    """
    swing = find_oscillation(record.op, record.pv, record.Ts)
    if not (swing.sustained and record.duration >= FEWEST_PERIODS * swing.period_s):
        return 0.0
    return coherence(record.pv, swing.period_s / record.Ts)


def of_friction(loops: CandidateLoops) -> float:
    """Return the largest regularity that the loop with friction reaches under its own load and
    noise; 0 where no friction was fitted.
    """
    if loops.sticky is None or loops.fitted is None:
        return 0.0
    return _largest_regularity(loops.sticky, kick=loops.fitted[0])


def of_tuning(loops: CandidateLoops) -> float:
    """Return the largest regularity that the sound loop reaches by itself."""
    return _largest_regularity(loops.alone, kick=0.0)


def _largest_regularity(loop: Loop, kick: float) -> float:
    # what a set point that swings does comes from outside
    runs = run_with_seeds(steady(loop), 0, _SEEDS, kick)
    if runs is None:
        return 0.0
    return max(regularity(run) for run in runs)

"""Runs and prepared records of the last few loops: the rules of a group are settled by running its
loops, and the last run of each is the scenario's.
"""

from __future__ import annotations

from collections import deque

from simbench.detectors.prepared import Prepared, prepare
from simbench.detectors.record import LoopRecord
from simbench.loop.run import Run
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_MOST = 32  # loops of a group
_runs: deque[tuple[Loop, int, Run]] = deque(maxlen=_MOST)
_prepared: deque[tuple[LoopRecord, Prepared]] = deque(maxlen=_MOST)


def run_once(loop: Loop, seed: int) -> Run:
    """Return `simulate(loop, seed)`; the run of a loop that was just run is kept."""
    for known, its, run in _runs:
        if known is loop and its == seed:
            return run
    run = simulate(loop, seed)
    _runs.append((loop, seed, run))
    return run


def prepare_once(record: LoopRecord) -> Prepared:
    """Return a record without MV made ready for judging; that of a run just made is kept."""
    for known, prepared in _prepared:
        if known is record:
            return prepared
    prepared = prepare(record.without_mv())
    _prepared.append((record, prepared))
    return prepared

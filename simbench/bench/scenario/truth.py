"""Truth: does the valve stick, and does the loop cycle because of it? Stored side by side, never
mixed.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from simbench.detectors.prepared import Prepared, prepare
from simbench.detectors.record import LoopRecord
from simbench.loop.motion import MIN_REVERSALS, Motion, largest_sine, motion
from simbench.loop.motion import least_swing as least_swing_of
from simbench.loop.resolve import friction, undisturbed
from simbench.loop.run import Run
from simbench.loop.simulate import simulate, valve_tail
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

_TAIL_PERIODS = 20
_LASTING = 0.8  # last third of the tail over the first
_TWIN = 0.5  # a twin with an ideal valve that moves this much of it moves for another reason
_MOMENTS = (
    0.0,
    0.25,
    0.5,
    0.75,
)  # of the record's last period, from its end back, at which the noise goes off
_FADING = 0.5  # below this the motion dies out; between this and LASTING it is not clear
_MAX_TAIL = 20_000  # samples
YES = "yes"
NO = "no"
_ENTRAINED = "entrained"
_UNCLEAR = "unclear"
CYCLED = (YES, NO, _ENTRAINED, _UNCLEAR)
_MOST = 32  # loops of a group
_known: deque[tuple[Loop, int, Cycled]] = deque(maxlen=_MOST)


@dataclass(frozen=True)
class Cycled:
    """Whether a loop cycles by itself because of its valve."""

    # {"yes", "no", "entrained", "unclear"}: entrained: it does not cycle alone, but the valve jumps
    # under the disturbance
    answer: str
    period: float = math.nan  # of MV in the tail (s); NaN when it does not swing
    swing: float = 0.0  # median distance (%) between reversals of MV in the tail


def simulate_with_truth(
    loop: Loop, seed: int = 0, *, period: float | None = None
) -> tuple[Run, Cycled]:
    """Run a loop, let it go on without noise under frozen disturbances and set point, and say
    whether it cycles.

    A valve without friction is its own twin: never "yes". The answer about a loop that was just
    asked about is kept.
    """
    run = run_once(loop, seed)
    if not run.sticky:
        return run, Cycled(NO)
    for known, its, cycled in _known:
        if known is loop and its == seed and period is None:
            return run, cycled
    cycled = _find_cycling(run, loop, seed, period)
    if period is None:
        _known.append((loop, seed, cycled))
    return run, cycled


def _find_cycling(run: Run, loop: Loop, seed: int, period: float | None) -> Cycled:
    """Say whether a sticky loop cycles."""
    # The period of the valve's motion, or of the record
    Ts = loop.sampling.Ts
    bar = least_swing(loop)
    late = motion(run.mv[run.record.n // 2 :], bar / 4)
    if period is None:
        period = late.period * Ts
        if not math.isfinite(period):
            period = run.record.duration / _TAIL_PERIODS

    # At several ends of the record: does the valve go on by itself
    found = None
    twin = healthy_twin(loop)
    for quiet in _quiet_moments(loop, period / Ts):
        tail, moved = _simulate_tail(loop, seed, period / Ts, bar, quiet)
        said = _goes_on_by_itself(twin, seed, tail, moved, bar, quiet)
        if said == YES:
            return Cycled(YES, moved.period * Ts, moved.swing)
        # what the loop does from the record's end on counts first; earlier ends only make it
        # unclear
        found = found or (said, moved)
        if said == _UNCLEAR:
            found = (_UNCLEAR, found[1])

    # A loop that moves without that, or is driven, is another answer
    assert found is not None
    said, moved = found
    if said == NO and _moves_steadily(run, late, loop, seed, period / Ts, bar):
        said = _UNCLEAR
    if said == NO and _is_driven(run) and np.ptp(run.mv[run.record.n // 2 :]) >= bar:
        said = _ENTRAINED
    return Cycled(said, moved.period * Ts, moved.swing)


def least_swing(loop: Loop) -> float:
    """Return the smallest swing of MV (%) that counts as a cycle: J/2, or S/20 of a valve without
    slip jump.
    """
    return least_swing_of(friction(loop))


def healthy_twin(loop: Loop) -> Loop:
    """Return the loop with an ideal valve in place of its friction, all else equal; a stage without
    friction stays.
    """
    # The valve without friction, where it has any
    if loop.effect:
        bare = loop.model_copy(update={"effect": ()})
    else:
        bare = loop
    if friction(bare):
        valve = Part(name="ideal")
    else:
        valve = loop.valve

    # Effects without friction stay
    ideal = bare.model_copy(update={"valve": Part(name="ideal")})
    kept = []
    for e in loop.effect:
        if not friction(ideal.model_copy(update={"effect": (e,)})):
            kept.append(e)
    return loop.model_copy(update={"valve": valve, "effect": tuple(kept)})


def _samples_of_tail(period: float) -> int:
    return min(max(math.ceil(_TAIL_PERIODS * period), 3 * _TAIL_PERIODS), _MAX_TAIL)


def _quiet_moments(loop: Loop, period: float) -> list[int]:
    # the noise of the loop file and of its effects; without any the four moments are one
    n = loop.sampling.n
    if undisturbed(loop).noise_std == 0:
        return [n]
    return sorted({max(n - round(share * period), 0) for share in _MOMENTS}, reverse=True)


def _simulate_tail(
    loop: Loop, seed: int, period: float, bar: float, quiet: int | None
) -> tuple[np.ndarray, Motion]:
    samples = _samples_of_tail(period)
    while True:
        tail = valve_tail(loop, seed, samples, quiet)
        moved = motion(tail, bar / 4)
        wanted = _samples_of_tail(
            moved.period if moved.reversals > 2 else 2.0 * samples / _TAIL_PERIODS
        )
        # a cycle that is slower than expected needs a longer tail; a valve that stands still does
        # not
        if np.ptp(tail[samples // 2 :]) < bar or wanted <= 1.25 * samples or samples >= _MAX_TAIL:
            return tail, moved
        samples = wanted


def _goes_on_by_itself(
    twin: Loop, seed: int, tail: np.ndarray, moved: Motion, bar: float, quiet: int
) -> str:
    """Say whether the valve goes on moving in one noise-free tail, and by itself: more than its
    healthy twin does.
    """
    if _keeps_swinging(moved, bar) and moved.lasting >= _FADING:
        healthy = valve_tail(twin, seed, tail.size, quiet)
        own = _TWIN * largest_sine(tail, moved.period) > largest_sine(healthy, moved.period)
        return YES if own and moved.lasting >= _LASTING else _UNCLEAR
    # still moving at the end, but too slowly for the longest tail
    if 0 < moved.reversals < MIN_REVERSALS and np.ptp(tail[-(tail.size // 3) :]) >= bar:
        return _UNCLEAR
    return NO


def _moves_steadily(
    run: Run, late: Motion, loop: Loop, seed: int, period: float, bar: float
) -> bool:
    """Whether the valve moves steadily all the same: undisturbed in the record, or as long as the
    noise goes on.
    """
    if not _is_driven(run) and _keeps_swinging(late, bar) and late.lasting >= _LASTING:
        return True
    if undisturbed(loop).noise_std == 0:
        return False
    _, moved = _simulate_tail(loop, seed, period, bar, None)
    return _keeps_swinging(moved, bar) and moved.lasting >= _FADING


def _keeps_swinging(moved: Motion, bar: float) -> bool:
    return moved.reversals >= MIN_REVERSALS and moved.swing >= bar


def _is_driven(run: Run) -> bool:
    late = slice(run.record.n // 2, run.record.n)
    return any(np.ptp(signal[late]) > 0 for signal in (run.load_in, run.load_out, run.record.sp))


# --- Runs and prepared records of the last few loops: the rules of a group are settled by running
# its loops, and the last run of each is the scenario's.

_MOST_KEPT = 32  # loops of a group
_runs: deque[tuple[Loop, int, Run]] = deque(maxlen=_MOST_KEPT)
_prepared: deque[tuple[LoopRecord, Prepared]] = deque(maxlen=_MOST_KEPT)


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

"""Truth: does the valve stick, and does the loop cycle because of it? Stored side by side, never mixed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop, Part
from simbench.bench.motion import Motion, largest_sine, motion
from simbench.loop.resolve import friction
from simbench.loop.run import Run
from simbench.loop.simulate import simulate

TAIL_PERIODS = 20
MIN_REVERSALS = 6
LASTING = 0.8  # last third of the tail over the first
TWIN = 0.5  # a twin with an ideal valve that moves this much of it moves for another reason
FADING = 0.5  # below this the motion dies out; between this and LASTING it is not clear
MAX_TAIL = 20_000  # samples
YES, NO, ENTRAINED, UNCLEAR = "yes", "no", "entrained", "unclear"
CYCLED = (YES, NO, ENTRAINED, UNCLEAR)


@dataclass(frozen=True)
class Cycled:
    """Whether a loop cycles by itself because of its valve.

    Parameters
    ----------
    answer : {"yes", "no", "entrained", "unclear"}
        entrained: it does not cycle alone, but the valve jumps under the disturbance.
    period : float
        Of MV in the tail (s); NaN when it does not swing.
    swing : float
        Median distance (%) between reversals of MV in the tail.
    """

    answer: str
    period: float = math.nan
    swing: float = 0.0


def simulate_with_truth(loop: Loop, seed: int = 0, *, period: float | None = None) -> tuple[Run, Cycled]:
    """Run a loop, go on with disturbances and set point frozen, and say whether it cycles.

    Parameters
    ----------
    loop : Loop
        What to run.
    seed : int
        Root of every random stream.
    period : float, optional
        Expected period (s) of the cycle; measured on the record when absent.

    Returns
    -------
    run : Run
        Its record is that of `simulate(loop, seed)`, bit for bit.
    cycled : Cycled
        yes: over 20 more periods MV reverses at least 6 times, by J/2 or more in the median (J = 0: S/20), does not
        fade (last third at least 0.8 of the first), and its largest sine at any period within a factor 3 is more than
        twice that of the twin with an ideal valve.

    Notes
    -----
    A valve without friction that follows OP exactly is its own twin: never "yes". Not for loops that drift without end.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "valve": {"model": "choudhury", "S": 5, "J": 2},
    ...     "sampling": {"Ts": 1, "n": 2000},
    ...     "setpoint": {"value": 50, "steps": [[10, 55]]}})
    >>> run, cycled = simulate_with_truth(loop)
    >>> cycled.answer, round(cycled.period / 94, 1)
    ('yes', 1.0)
    """
    if loop.valve.name == "ideal" and not loop.effect:
        return simulate(loop, seed), Cycled(NO)
    Ts = loop.sampling.Ts
    bar = least_swing(loop)
    if period is None:
        first = simulate(loop, seed)
        period = motion(_mv(first.record)[first.record.n // 2 :], bar / 4).period * Ts
        period = period if math.isfinite(period) else first.record.duration / TAIL_PERIODS
    samples = _samples(period / Ts)
    while True:
        run = simulate(loop, seed, tail=samples)
        tail = _mv(run.tail)
        moved = motion(tail, bar / 4)
        wanted = _samples(moved.period if moved.reversals > 2 else 2.0 * samples / TAIL_PERIODS)
        # a cycle that is slower than expected needs a longer tail; a valve that stands still does not
        if np.ptp(tail[samples // 2 :]) < bar or wanted <= 1.25 * samples or samples >= MAX_TAIL:
            break
        samples = wanted
    return run, _answer(loop, seed, run, moved, bar)


def least_swing(loop: Loop) -> float:
    """Return the smallest swing of MV (%) that counts as a cycle: J/2, or S/20 of a valve without slip jump.

    Parameters
    ----------
    loop : Loop
        Any loop; a friction model enters by its mapped (S, J).

    Returns
    -------
    float

    Examples
    --------
    >>> from scenarios.spec import load_loop
    >>> base = {"plant": {"type": "integrating", "K": 1}, "controller": {"type": "P", "Kc": 1}, "sampling": {"Ts": 1}}
    >>> least_swing(Loop.from_table({**base, "valve": {"model": "deadband", "S": 5}}))
    0.25
    """
    bands = friction(loop)
    S, J = (max((band[i] for band in bands), default=0.0) for i in (0, 1))
    return max(J / 2 if J > 0 else S / 20, 1e-6)


def healthy_twin(loop: Loop) -> Loop:
    """Return the loop with an ideal valve in place of its friction, all else equal."""
    ideal = loop.model_copy(update={"valve": Part(name="ideal"), "effect": ()})
    kept = tuple(e for e in loop.effect if not friction(ideal.model_copy(update={"effect": (e,)})))
    return ideal.model_copy(update={"effect": kept})


def _samples(period: float) -> int:
    return min(max(math.ceil(TAIL_PERIODS * period), 3 * TAIL_PERIODS), MAX_TAIL)


def _mv(record: LoopRecord | None) -> np.ndarray:
    assert record is not None
    assert record.mv is not None
    return record.mv


def _answer(loop: Loop, seed: int, run: Run, moved: Motion, bar: float) -> Cycled:
    tail = _mv(run.tail)
    swings = moved.reversals >= MIN_REVERSALS and moved.swing >= bar

    def said(answer: str) -> Cycled:
        return Cycled(answer, moved.period * loop.sampling.Ts, moved.swing)

    if swings and moved.lasting >= FADING:
        twin = _mv(simulate(healthy_twin(loop), seed, tail=tail.size).tail)
        own = TWIN * largest_sine(tail, moved.period) > largest_sine(twin, moved.period)
        if own and moved.lasting >= LASTING:
            return said(YES)
        return said(UNCLEAR if run.sticky else NO)
    # still moving at the end, but too slowly for the longest tail
    if run.sticky and 0 < moved.reversals < MIN_REVERSALS and np.ptp(tail[-(tail.size // 3) :]) >= bar:
        return said(UNCLEAR)
    late = slice(run.record.n // 2, run.record.n)
    driven = np.ptp(run.load_in[late]) > 0 or np.ptp(run.load_out[late]) > 0
    if run.sticky and driven and np.ptp(_mv(run.record)[late]) >= bar:
        return said(ENTRAINED)
    return said(NO)

"""Simulate what a change of controller gain does to a loop with a sound valve and to one with
friction, and tell which of them an observed change is like.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from simbench.detectors.errors import UserError
from simbench.detectors.signal.holds import holds
from simbench.detectors.signal.oscillation import oscillation_of
from simbench.loop.resolve import friction, resolve_loop
from simbench.loop.run import run_setup
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

_SEEDS = 8  # simulations of each loop
_TRANSIENT = 3  # of a run one part in so many is cut off at its beginning
# what a measured ratio of periods, and of amplitudes, scatters at least (logarithms)
_LEAST = np.array([0.03, 0.15])
_OUTSIDE = np.array([0.03, 0.7])  # of an oscillation from outside: its amplitude may change
_FAR = 3.0  # standard deviations, beyond which a change is not the one that was simulated
# S over the amplitude of OP of the friction that is tried where none is known, and J over S
_SIZES = (0.6, 1.0, 1.4)
_JUMP = 0.5
_LIGHT = 0.2  # of S, a step of the load that starts a cycle which a large one does not
DRIVEN = ("sine", "propagated")  # what swings a loop from outside
# density of changes that no simulation came near: it holds for sound and sticking valves alike
_SLIGHT = 0.05


@dataclass(frozen=True)
class Expected:
    """What simulations of one hypothesis did: `changes` (m, 2) of those that oscillate before the
    change, logarithms of the ratios of period and of OP's amplitude, NaN where the oscillation does
    not go on; `tried`, how many there were.
    """

    changes: np.ndarray
    tried: int

    @property
    def period(self) -> float:
        """Median ratio of the periods; NaN where none goes on."""
        on = self.changes[np.isfinite(self.changes[:, 0]), 0]
        if on.size:
            return float(np.exp(np.median(on)))
        return math.nan

    def alike(self, other: Expected) -> bool:
        """Return whether both do the same to the period, so that it cannot tell them apart."""
        ends = np.isnan(self.period), np.isnan(other.period)
        if any(ends):
            return all(ends)
        return abs(math.log(self.period / other.period)) <= 2.0 * float(_LEAST[0])

    def near(self, before: Phase, after: Phase) -> bool:
        """Return whether an observed change of the period is one that the simulations show, within
        what these and the measurement scatter.
        """
        on = self.changes[np.isfinite(self.changes[:, 0]), 0]
        if not after.goes_on or not on.size:
            return not after.goes_on and on.size < len(self.changes)
        spread = float(np.hypot(np.std(on), np.nan_to_num(ratio_error(before, after))))
        off = abs(float(_log_change(before, after)[0]) - float(np.mean(on)))
        return off <= _FAR * max(spread, float(_LEAST[0]))

    def likelihood(self, before: Phase, after: Phase) -> float:
        """Return the likelihood of an observed change of a loop that oscillates before it."""
        # The chance that the loop goes on
        on = self.changes[np.isfinite(self.changes[:, 0])]
        goes_on = (len(on) + 0.5) / (len(self.changes) + 1.0)
        if not after.goes_on:
            return 1.0 - goes_on

        # The density of its change, about those that were simulated
        if len(on) > 2:
            spread = np.cov(on.T)
        else:
            spread = np.zeros((2, 2))
        if len(on):
            near = _change_density(before, after, on.mean(axis=0), spread, _LEAST)
        else:
            near = 0.0
        return goes_on * (near + _SLIGHT)


def expect_change(
    loops: Iterable[tuple[Loop, float, tuple[float, float]]],
    lengths: tuple[int, int],
    Ts: float,
    nudge: float = 0.0,
) -> Expected:
    """Simulate loops before and after a change of gain.

    Parameters
    ----------
    loops : iterable of (Loop, float, (float, float))
        Each with the offset (%) of OP that starts it, and the factors on Kc before and after.
    lengths : (int, int)
        Samples of both phases.
    Ts : float
        Sampling period (s).
    nudge : float
        Step of the load (%) that starts each loop, in place of the offset.

    Returns
    -------
    Expected
        What the loops did that oscillate before the change.
    """
    changes = []
    tried = 0
    for loop, kick, factors in loops:
        for seed in range(_SEEDS):
            tried += 1
            phases = []
            for after, (f, n) in enumerate(zip(factors, lengths)):
                phases.append(_simulate_phase(loop, f, n, (kick, nudge), 2 * seed + after, Ts))
            if phases[0] is not None and phases[1] is not None and phases[0].goes_on:
                changes.append(_log_change(phases[0], phases[1]))
    return Expected(np.array(changes).reshape(-1, 2), tried)


def with_friction(loop: Loop, amplitude: float) -> list[tuple[Loop, float]]:
    """Return a loop that its valve makes swing, and nothing from outside, and the offset (%) of OP
    that starts it: with its own friction, or valves that stick by about an amplitude (%) of OP.
    """
    loads = tuple(part for part in loop.disturbance if part.name not in DRIVEN)
    alone = loop.model_copy(update={"disturbance": loads})
    if friction(loop):
        S = max(S for S, _ in friction(loop))
        return [(alone, 1.0 + S)]
    out = []
    for S in (size * amplitude for size in _SIZES):
        stuck = Part(name="choudhury", parameters={"S": S, "J": _JUMP * S})
        out.append((alone.model_copy(update={"valve": stuck}), 1.0 + S))
    return out


def odds_of_friction(
    before: Phase, after: Phase, sound: Expected, sticky: Expected, outside: bool
) -> float:
    """Return the logarithm of how much likelier the change is with friction than without; with
    `outside` something beyond the loops that were simulated may swing them.
    """
    without = sound.likelihood(before, after)
    if outside:
        without = 0.5 * (without + _from_outside(before, after))
    return math.log(sticky.likelihood(before, after) / without)


def kept(before: Phase, after: Phase) -> bool:
    """Return whether an oscillation kept its period, as one from outside does."""
    if after.goes_on:
        ratio = float(_log_change(before, after)[0])
    else:
        ratio = math.inf
    return abs(ratio) <= _FAR * float(_OUTSIDE[0])


def _from_outside(before: Phase, after: Phase) -> float:
    """Return the likelihood of a change where an oscillation keeps its period."""
    if not after.goes_on:
        return _SLIGHT
    return _change_density(before, after, np.zeros(2), np.zeros((2, 2)), _OUTSIDE) + _SLIGHT


def _change_density(
    before: Phase, after: Phase, mean: np.ndarray, spread: np.ndarray, least: np.ndarray
) -> float:
    """Return the density of an observed change about an expected one."""
    measured = np.diag([np.nan_to_num(ratio_error(before, after)) ** 2, 0.0])
    spread = spread + np.diag(least**2) + measured
    return float(scipy.stats.multivariate_normal(mean, spread).pdf(_log_change(before, after)))


def _simulate_phase(
    loop: Loop, factor: float, n: int, start: tuple[float, float], seed: int, Ts: float
) -> Phase | None:
    """Return what one simulation did once it had settled; None where it runs away or to a limit.

    From rest not every cycle starts, and one that went on before the change goes on: other starts
    are tried.
    """
    # Longer by the transient, with the changed gain
    length = n * _TRANSIENT // (_TRANSIENT - 1)
    changed = loop.with_("controller.Kc", loop.controller.Kc * factor).with_("sampling.n", length)
    kick, nudge = start

    # From the loop at rest, from a kick, and from a light push of the load
    phase = None
    starts = ((0.0 if nudge else kick, nudge), (kick, 0.0), (0.0, _LIGHT * kick))
    for offset, step in dict.fromkeys(starts):
        try:
            setup = resolve_loop(changed, seed)
            setup.load_in[1:] += step
            op = run_setup(setup, kick=offset).record.op
        except UserError:
            return None

        # The first start that goes on decides
        phase = measure(np.asarray(op)[length - n :], Ts, factor)
        if phase.goes_on or kick == 0.0:
            break
    return None if phase is None or phase.saturated else phase


def _log_change(before: Phase, after: Phase) -> np.ndarray:
    ratios: Sequence[float] = (after.period / before.period, after.amplitude / before.amplitude)
    return np.log(ratios)


# --- Measure period and amplitude of an oscillating OP, with the error of the period.

_SMALLEST = 0.01  # amplitude of OP (%) below which there is nothing to see
_BAND = 0.5  # of OP's std, which it must cross for a new cycle to begin
_WIDE = 1.96  # standard errors on either side of a 95 % interval


@dataclass(frozen=True, eq=False)
class Phase:
    """An oscillation before or after the change of gain."""

    Kc: float  # controller gain (% per PV unit)
    period: float  # s; NaN when there is no sustained oscillation
    amplitude: float  # of OP (%), as sqrt(2) times its standard deviation
    # whether OP rests at its lowest or highest value for more than 2 % of the time: at 0 or 100,
    # or elsewhere for 3 samples or more at a time (the crest of a smooth wave may meet one value in
    # every cycle)
    saturated: bool
    # standard error of the period (s), from the spread of the cycles' lengths
    error: float = np.nan

    @property
    def goes_on(self) -> bool:
        """Whether OP oscillates on."""
        return bool(np.isfinite(self.period))

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, the period with its 95 % interval; None where a number is missing."""
        return plain({
            "Kc": self.Kc, "period": self.period,
            "period_interval": interval(self.period, self.error),
            "amplitude": self.amplitude, "saturated": self.saturated,
        })  # fmt: skip


def measure(op: np.ndarray, Ts: float, Kc: float) -> Phase:
    """Return period and amplitude of an oscillating OP; the period is NaN when it is not
    sustained.
    """
    cycle = oscillation_of(op, Ts)
    amplitude = float(np.sqrt(2) * op.std())
    seen = cycle.sustained and amplitude > _SMALLEST
    at_ends = max(_share_at(op, float(op.min())), _share_at(op, float(op.max())))
    saturated = bool(amplitude > _SMALLEST and at_ends > 0.02)
    if not seen:
        return Phase(Kc, np.nan, amplitude, saturated)
    return Phase(Kc, cycle.period_s, amplitude, saturated, _period_error(op, Ts))


def _period_error(op: np.ndarray, Ts: float) -> float:
    """Return the standard error of the mean cycle (s): cycles lie between upward crossings of a
    band around the mean.
    """
    x = op - op.mean()
    band = _BAND * x.std()
    side = np.where(x > band, 1, np.where(x < -band, -1, 0))
    out = np.flatnonzero(side)
    ups = out[1:][np.diff(side[out]) > 0]
    lengths = np.diff(ups)
    if lengths.size < 2:
        return np.nan
    # two crossings are known to a sample
    return float(np.hypot(lengths.std(ddof=1) / np.sqrt(lengths.size), 1.0 / lengths.size) * Ts)


def ratio_error(before: Phase, after: Phase) -> float:
    """Return the relative standard error of the ratio of two periods; NaN where one is missing."""
    return float(np.hypot(before.error / before.period, after.error / after.period))


def interval(value: float, error: float) -> tuple[float, float] | None:
    """Return the ends of a 95 % interval; None where a number is missing."""
    if np.isfinite(value + error):
        return (value - _WIDE * error, value + _WIDE * error)
    return None


def _share_at(op: np.ndarray, value: float) -> float:
    """Return the share of the time that OP rests at a value."""
    length = holds(op)
    there = op[np.cumsum(length) - 1] == value
    return float(length[there & ((length >= 3) | (value in (0.0, 100.0)))].sum() / op.size)


def plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return numbers in JSON types, None where one is missing."""
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in values.items()}
